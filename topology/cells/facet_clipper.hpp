// Cells clipped by the triangles of a surface themselves, exactly: for cells at sharp edges, where the zero set of the
// distance between the corners of a polygon is no arc. Private to voronoi_cells.cpp.
#pragma once

#include "topology/cells/cell_clipper.hpp"
#include "topology/domain/surface_facets.hpp"

#include <optional>

namespace spherecut::topology {

/// Boundary of a cell on one smooth piece of the surface.
struct FacetPatch {
  int piece = -1;
  Vector3 area = Vector3::Zero();     // outward, in the unit of the cell
  Vector3 centroid = Vector3::Zero(); // likewise
  double size = 0;                    // area without direction
};

/// The triangles near one cell, in the unit and about the node of the cell.
class FacetClipper {
 public:
  /// Of the cell of a node, whose corners (relative to it, in units of its spacing) are given.
  FacetClipper(const SurfaceFacets& facets, const Vector3& node, double spacing, const std::vector<Vector3>& corners);

  /// Parts of a convex polygon inside the body, as loops that turn as the polygon does (holes the other way).
  /// `is_inside` tells of a polygon whose border the surface does not cross, by its corner farthest from that: others
  /// may lie on it. Nothing where the surface does not leave closed loops, by rounding.
  [[nodiscard]] std::optional<std::vector<std::vector<Vector3>>> inside(const std::vector<Vector3>& polygon,
                                                                        bool is_inside) const;

  /// Parts of the surface within the convex cell that lies behind all of these planes (normal, offset), by piece.
  [[nodiscard]] std::vector<FacetPatch> within(const std::vector<Plane>& planes) const;

 private:
  struct Facet {
    std::array<Vector3, 3> corners;
    Triangle vertices;
    int piece;
  };
  std::vector<Facet> facets_;
};

} // namespace spherecut::topology
