// Tetrahedra as plain arrays, and their shapes.
#pragma once

#include "topology/base/types.hpp"

#include <functional>

namespace spherecut::experiments::ledger {

/// Faces of the tetrahedra lie in the cut's plane all through the organ; no tetrahedron crosses it.
struct TetMesh {
  std::vector<Vector3> vertices;
  std::vector<std::array<int, 4>> tets; // positive volume
};

/// 12 (3 V)^(2/3) / sum of squared edges: 1 for a regular tetrahedron, 0 for a flat one.
double shape_quality(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d);
double smallest_quality(const std::vector<Vector3>& vertices, const std::vector<std::array<int, 4>>& tets);

/// Six times the volume.
double six_volumes(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d);

} // namespace spherecut::experiments::ledger
