// Exact signed distance to a closed triangulated surface.
#pragma once

#include "topology/surface/mesh.hpp"

#include <memory>

namespace spherecut::topology {

/// The point of a surface nearest to a query point.
struct NearestPoint {
  Vector3 point = Vector3::Zero();  // m, on the surface
  Vector3 normal = Vector3::Zero(); // unit, gradient of the signed distance at the query point
  double distance = 0;              // m, negative inside
  int triangle = -1;                // a triangle that holds the point
};

/// Keeps a tree of boxes over the triangles of one surface. The sign comes from the angle-weighted pseudonormal of the
/// nearest face, edge or vertex, which is right everywhere for a closed outward 2-manifold [Baerentzen and Aanaes
/// 2005]. Queries are const and thread safe.
class SurfaceDistance {
 public:
  /// Throws InputError when the mesh is empty, has indices out of range, zero-area triangles, or is not closed.
  explicit SurfaceDistance(const SurfaceMesh& mesh);
  ~SurfaceDistance();
  SurfaceDistance(SurfaceDistance&&) noexcept;
  SurfaceDistance& operator=(SurfaceDistance&&) noexcept;

  /// Exact nearest point. `hint` is any triangle thought to be near, -1 when unknown: it changes the time, not the
  /// distance.
  [[nodiscard]] NearestPoint nearest(const Vector3& x, int hint = -1) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace spherecut::topology
