// A closed test surface of any size with hills and hollows. Header only: benchmarks use it too.
#pragma once

#include "topology/surface/mesh.hpp"

#include <cmath>
#include <map>

namespace spherecut::tests {

/// Sphere of the given radius (m) about `centre` with bumps of relative height `bump` (0: round), from a cube whose
/// edges are cut into n pieces: 12 n^2 triangles. Vertices lie on the surface.
inline topology::SurfaceMesh bumpy_sphere(int n, double radius, double bump, const Vector3& centre = Vector3::Zero()) {
  topology::SurfaceMesh mesh;
  std::map<std::array<int, 3>, int> vertex_at;
  const auto vertex = [&](const std::array<int, 3>& lattice) {
    const auto [entry, added] = vertex_at.emplace(lattice, static_cast<int>(mesh.vertices.size()));
    if (added) {
      // tan() evens out the cells' sizes.
      Vector3 u;
      for (int k = 0; k < 3; ++k)
        u[k] = std::tan((2.0 * lattice[k] / n - 1) * 0.78539816339744831);
      u.normalize();
      const double height =
          std::sin(9 * u.x() + 1) * std::sin(8 * u.y() + 2) + 0.7 * std::sin(17 * u.z()) * std::cos(14 * u.x() - 1);
      mesh.vertices.emplace_back(centre + radius * (1 + bump * height) * u);
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int a, int b) {
            std::array<int, 3> lattice{};
            lattice[axis] = side * n;
            lattice[(axis + 1) % 3] = a;
            lattice[(axis + 2) % 3] = b;
            return vertex(lattice);
          };
          const int p = at(i, j), q = at(i + 1, j), r = at(i + 1, j + 1), s = at(i, j + 1);
          if (side == 1) {
            mesh.triangles.push_back({p, q, r});
            mesh.triangles.push_back({p, r, s});
          } else {
            mesh.triangles.push_back({p, r, q});
            mesh.triangles.push_back({p, s, r});
          }
        }
  return mesh;
}

} // namespace spherecut::tests
