// Pairs of triangles that pass through each other.
#pragma once

#include "topology/surface/mesh.hpp"

#include <utility>

namespace spherecut::topology {

/// Pairs of triangles of the mesh that meet elsewhere than in what they share, in ascending order; decided exactly
/// (CGAL). A triangle without area counts as meeting itself. Throws InputError when the mesh is not an oriented
/// 2-manifold.
std::vector<std::pair<int, int>> self_intersections(const SurfaceMesh& mesh);

} // namespace spherecut::topology
