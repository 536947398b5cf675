// A triangulated surface as plain arrays, and the few measures everything needs.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::topology {

/// Triangle soup with shared vertices. A checked organ surface is closed, 2-manifold and outward oriented.
struct SurfaceMesh {
  std::vector<Vector3> vertices;   // m
  std::vector<Triangle> triangles; // indices into vertices, counter-clockwise from outside
};

/// Smallest axis-aligned box around the vertices (zero box when there are none).
BoundingBox bounds(const SurfaceMesh& mesh);

/// Enclosed volume, m3 (divergence theorem; negative when the orientation is inward).
double volume(const SurfaceMesh& mesh);

/// Throws InputError when a closed surface is oriented inwards.
void require_outward(const SurfaceMesh& mesh);

/// Total area, m2.
double area(const SurfaceMesh& mesh);

/// Unit normal of one triangle.
Vector3 triangle_normal(const SurfaceMesh& mesh, int triangle);

/// Area-weighted unit normals of all vertices.
std::vector<Vector3> vertex_normals(const SurfaceMesh& mesh);

/// For every triangle the triangles across its edges (v0v1, v1v2, v2v0), -1 on a border. Indices must be in range.
std::vector<std::array<int, 3>> triangle_neighbours(const SurfaceMesh& mesh);

} // namespace spherecut::topology
