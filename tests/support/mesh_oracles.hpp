// Slow and simple answers about a triangulated surface, against which the quick ones are tested.
#pragma once

#include "topology/surface/mesh.hpp"

#include <random>

namespace spherecut::tests {

/// Distance from x to the nearest of all triangles, m.
double brute_force_distance(const topology::SurfaceMesh& mesh, const Vector3& x);

/// Whether x is inside a closed outward surface, by winding number (sum of solid angles, van Oosterom and Strackee
/// 1983).
bool inside_by_winding(const topology::SurfaceMesh& mesh, const Vector3& x);

/// Uniform point in the box grown by `margin` times its extent on every side.
Vector3 random_point(const BoundingBox& box, std::mt19937& random, double margin = 0.3);

} // namespace spherecut::tests
