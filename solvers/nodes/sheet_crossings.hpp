// Where sharp edges of the surface pass through sheets, and where sheets pass through one another.
#pragma once

#include "solvers/nodes/sheets.hpp"

namespace spherecut::solvers {

inline bool overlap(const BoundingBox& a, const BoundingBox& b) {
  return (a.lower.array() <= b.upper.array()).all() && (b.lower.array() <= a.upper.array()).all();
}

inline BoundingBox box_of(const Vector3& a, const Vector3& b) {
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

inline BoundingBox box_of(const Vector3& a, const Vector3& b, const Vector3& c) {
  return {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
}

inline bool within(const BoundingBox* region, const BoundingBox& box) {
  return region == nullptr || overlap(*region, box);
}

/// In the order of the curves and segments. Edges that run along a sheet, within 12 degrees, are left out.
std::vector<SharpCrossing> edge_crossings(const topology::Domain& domain, const SharpFeatures& features,
                                          const SpacingField& spacing, const topology::Incision& incision,
                                          const topology::SurfaceMesh& surface, const BoundingBox* region);

/// One segment per pair of triangles that meet: of two sheets, or of one when they share no vertex.
std::vector<std::array<Vector3, 2>> sheet_crossings(const topology::Incision& incision, const BoundingBox* region);

} // namespace spherecut::solvers
