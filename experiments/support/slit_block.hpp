// A block with a slit of its own surface: two legs side by side on a base, for the experiment real_world and for tests.
#pragma once

#include "topology/surface/mesh.hpp"

#include <vector>

namespace spherecut::experiments {

struct SlitBlock {
  double leg = 0.02, slit = 0.001, depth = 0.03, base = 0.01, height = 0.05; // m, along x, x, y, z, z

  /// Without a slit: a whole block.
  [[nodiscard]] topology::SurfaceMesh surface() const {
    const double right = leg + slit;
    if (slit == 0)
      return extruded({{0, 0, 0}, {2 * leg, 0, 0}, {2 * leg, 0, height}, {0, 0, height}}, {{0, 1, 2}, {0, 2, 3}},
                      depth);
    return extruded({{0, 0, 0},
                     {right + leg, 0, 0},
                     {right + leg, 0, height},
                     {right, 0, height},
                     {right, 0, base},
                     {leg, 0, base},
                     {leg, 0, height},
                     {0, 0, height}},
                    {{0, 1, 4}, {0, 4, 5}, {1, 2, 3}, {1, 3, 4}, {0, 5, 6}, {0, 6, 7}}, depth);
  }

  /// An outline at y = 0 that turns about -y, divided into triangles, drawn out along y.
  static topology::SurfaceMesh extruded(const std::vector<Vector3>& outline, const std::vector<Triangle>& triangles,
                                        double depth) {
    topology::SurfaceMesh mesh;
    const int n = static_cast<int>(outline.size());
    for (const double y : {0.0, depth})
      for (const Vector3& corner : outline)
        mesh.vertices.emplace_back(corner.x(), y, corner.z());
    for (const Triangle& t : triangles) {
      mesh.triangles.push_back(t);
      mesh.triangles.push_back({t[0] + n, t[2] + n, t[1] + n});
    }
    for (int i = 0; i < n; ++i) {
      const int next = (i + 1) % n;
      mesh.triangles.push_back({i, i + n, next + n});
      mesh.triangles.push_back({i, next + n, next});
    }
    return mesh;
  }
};

} // namespace spherecut::experiments
