// Polygons of a Voronoi cell clipped by the curved part of the body's surface. Private to voronoi_cells.cpp.
#pragma once

#include "topology/domain/domain.hpp"

namespace spherecut::topology {

/// Planar, in units of the spacing h of the node that it is relative to.
struct CellPolygon {
  std::vector<Vector3> vertices;
  std::vector<double> phi; // curved distance at the vertices
};

struct PolygonMeasure {
  Vector3 area = Vector3::Zero();
  Vector3 centroid = Vector3::Zero();
};

/// Area vector and centroid of a planar polygon; zero without area.
PolygonMeasure measure(const std::vector<Vector3>& polygon);

/// Clips polygons by phi < 0 and collects the points where they met the curved surface.
class CurvedClipper {
 public:
  CurvedClipper(const Domain& domain, const Vector3& node, double spacing)
      : domain_(domain), node_(node), spacing_(spacing) {}

  [[nodiscard]] double phi(const Vector3& local) const {
    return domain_.curved_distance(node_ + spacing_ * local) / spacing_;
  }

  /// Returns false when nothing of the polygon lies inside.
  bool clip(CellPolygon& polygon);

  [[nodiscard]] bool met_surface() const { return surface_count_ > 0; }
  [[nodiscard]] Vector3 surface_mean() const { return surface_sum_ / surface_count_; }

 private:
  [[nodiscard]] Vector3 root(Vector3 a, double phi_a, Vector3 b, double phi_b) const;
  void add_arc(const Vector3& from, const Vector3& to, const Vector3& normal, std::vector<Vector3>& kept) const;

  const Domain& domain_;
  Vector3 node_;
  double spacing_;
  Vector3 surface_sum_ = Vector3::Zero();
  int surface_count_ = 0;
};

} // namespace spherecut::topology
