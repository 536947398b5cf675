// A closed surface and open sheets subdivided, exactly, along all the lines where they meet.
//
// Every input triangle is refined into facets whose edges lie along its intersections with all others. Points are
// identified by their exact rational coordinates, so the facets form a simplicial complex whatever the position of the
// triangles: through corners, along edges, coplanar, coincident. The refinement of one triangle is a function of the
// set of its intersections alone (constrained Delaunay in its plane, ties broken by coordinates), so it does not matter
// in how many steps the sheets were added, and coplanar triangles agree where they overlap.
#pragma once

#include "topology/surface/mesh.hpp"

#include <memory>

namespace spherecut::topology {

class ExactArrangement {
 public:
  /// The surface must be closed, outward, and free of self-intersections; its triangles become facets 0, 1, 2, ...
  explicit ExactArrangement(const SurfaceMesh& surface);
  ~ExactArrangement();
  ExactArrangement(const ExactArrangement&) = delete;
  ExactArrangement& operator=(const ExactArrangement&) = delete;

  /// Facets that ceased to bound or cut the solid, and that newly do.
  struct Change {
    std::vector<int> removed, added; // ascending
    int crossed = 0;                 // input triangles whose refinement was redone
  };

  /// Adds sheet triangles (corners, m, finite); those without area are left out. Input triangles are numbered on from
  /// those of the surface.
  Change add(const std::vector<std::array<Vector3, 3>>& triangles);

  struct Facet {
    Triangle points; // oriented as its input triangle
    int source;      // input triangle
  };
  [[nodiscard]] int facet_count() const;
  [[nodiscard]] const Facet& facet(int facet) const;
  /// Of the surface, or of a sheet inside the solid and not coinciding with the surface or an earlier sheet.
  [[nodiscard]] bool active(int facet) const;
  [[nodiscard]] bool on_surface(int facet) const;

  [[nodiscard]] int point_count() const;
  /// m; exact coordinates rounded, always alike for the same exact point.
  [[nodiscard]] const Vector3& position(int point) const;

  /// Appends the active facets with this corner, in a reproducible order.
  void facets_at(int point, std::vector<int>& found) const;
  /// Appends the active facets with this edge.
  void facets_at_edge(int from, int to, std::vector<int>& found) const;

  /// Sorts facets that have the edge by their angle, counter-clockwise about the direction from -> to.
  void sort_about_edge(int from, int to, std::vector<int>& facets) const;

  struct RayCrossing {
    int facet;
    bool along_normal;
  };
  /// The active facets that some ray from the middle of a facet, starting along or against its normal, passes through,
  /// in order. Looks at all facets.
  [[nodiscard]] std::vector<RayCrossing> ray_from(int facet, bool along_normal);

  /// Corners of an input triangle, m.
  [[nodiscard]] std::array<Vector3, 3> source_corners(int source) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

} // namespace spherecut::topology
