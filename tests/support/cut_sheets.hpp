// Sheets of incisions for tests.
#pragma once

#include "topology/surface/mesh.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>

namespace spherecut::tests {

/// Grid of n x m quads over [0, 1]^2, halved, mapped by `place`.
inline topology::SurfaceMesh mapped_sheet(int n, int m, const std::function<Vector3(double, double)>& place) {
  topology::SurfaceMesh mesh;
  for (int j = 0; j <= m; ++j)
    for (int i = 0; i <= n; ++i)
      mesh.vertices.push_back(place(static_cast<double>(i) / n, static_cast<double>(j) / m));
  for (int j = 0; j < m; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, d = a + n + 1, c = d + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

/// Rectangle from a corner along u and v, with normal along u x v.
inline topology::SurfaceMesh flat_sheet(const Vector3& corner, const Vector3& u, const Vector3& v, int n, int m) {
  return mapped_sheet(n, m, [&](double s, double t) -> Vector3 { return corner + s * u + t * v; });
}

/// Disc as `rings` rings of triangles inside a regular polygon of `sides` sides whose area is that of the circle.
inline topology::SurfaceMesh disc_sheet(const Vector3& centre, const Vector3& normal, double radius, int rings,
                                        int sides) {
  const Vector3 n = normal.normalized(), u = n.unitOrthogonal(), v = n.cross(u);
  const double turn = 2 * std::numbers::pi / sides, outer = radius * std::sqrt(turn / std::sin(turn));
  topology::SurfaceMesh mesh;
  mesh.vertices.push_back(centre);
  for (int r = 1; r <= rings; ++r)
    for (int k = 0; k < sides; ++k)
      mesh.vertices.emplace_back(centre + outer * r / rings * (std::cos(k * turn) * u + std::sin(k * turn) * v));
  for (int k = 0; k < sides; ++k) {
    const int next = (k + 1) % sides;
    mesh.triangles.push_back({0, 1 + k, 1 + next});
    for (int r = 1; r < rings; ++r) {
      const int inner = 1 + (r - 1) * sides, beyond = inner + sides;
      mesh.triangles.push_back({inner + k, beyond + k, beyond + next});
      mesh.triangles.push_back({inner + k, beyond + next, inner + next});
    }
  }
  return mesh;
}

} // namespace spherecut::tests
