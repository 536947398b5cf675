// Parts of a body with a material of their own, and the faces between them and the rest.
#pragma once

#include "solvers/elasticity/material.hpp"
#include "topology/domain/domain.hpp"

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace spherecut::solvers {

/// A smooth surface where the material may change. Const calls must be thread safe.
struct RegionFace {
  std::function<double(const Vector3& x)> distance;   // signed, m; negative on the side of the region
  std::function<Vector3(const Vector3& x)> normal;    // unit, gradient of the distance
  std::function<Matrix3(const Vector3& x)> turning{}; // gradient of the normal, 1/m; empty: the face is flat
};

/// Where every face has a negative distance the body has this material.
struct MaterialRegion {
  std::string name; // for messages
  std::vector<RegionFace> faces;
  Material material;
  [[nodiscard]] bool holds(const Vector3& x) const;
  /// Depth of x inside the region, m; negative outside.
  [[nodiscard]] double depth(const Vector3& x) const;
};

/// The half-space normal . x <= offset.
std::vector<RegionFace> half_space_faces(const Plane& plane);
/// Of the half-space, the part that is nearer to its plane than `thickness`, m.
std::vector<RegionFace> slab_faces(const Plane& plane, double thickness);
std::vector<RegionFace> ball_faces(const Vector3& centre, double radius);
/// Its six planes.
std::vector<RegionFace> box_faces(const Vector3& lower, const Vector3& upper);
/// Inside a closed solid.
std::vector<RegionFace> solid_faces(const std::shared_ptr<const topology::Domain>& solid);
/// Depths from `from` to `to`, m, below the surface of the body; from = 0 begins at the surface itself.
std::vector<RegionFace> depth_faces(const std::shared_ptr<const topology::Domain>& body, double from, double to);

/// Regions of one body, which do not overlap. Immutable once made; const calls are thread safe.
class MaterialRegions {
 public:
  /// Throws InputError for no region, a region without faces, or a material that is none.
  explicit MaterialRegions(std::vector<MaterialRegion> regions);

  [[nodiscard]] const std::vector<MaterialRegion>& all() const { return regions_; }
  /// Of every region, one after the other.
  [[nodiscard]] const std::vector<RegionFace>& faces() const { return faces_; }
  /// First region that holds x, -1: none does.
  [[nodiscard]] int at(const Vector3& x) const;
  /// Material there; `elsewhere` where no region holds x.
  [[nodiscard]] const Material& material_at(const Vector3& x, const Material& elsewhere) const;
  /// Largest Young's modulus of the materials nearer to x than `reach`, m; Pa.
  [[nodiscard]] double stiffest_near(const Vector3& x, double reach, const Material& elsewhere) const;
  /// Throws InputError where two regions hold one of the points, with their names and the place.
  void require_apart(std::span<const Vector3> points) const;
  /// Throws InputError where a region holds none of the points, the quadrature points of nodes `spacing` m apart.
  void require_resolved(std::span<const Vector3> points, double spacing) const;

 private:
  std::vector<MaterialRegion> regions_;
  std::vector<RegionFace> faces_;
};

} // namespace spherecut::solvers
