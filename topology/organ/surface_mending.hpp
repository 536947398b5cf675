// The repairs that surface_check makes, each on its own.
#pragma once

#include "topology/files/surface_io.hpp"

#include <optional>

namespace spherecut::topology {

/// For every vertex the first vertex within `tolerance` m of it (itself when there is none before it).
std::vector<int> coinciding_vertices(const std::vector<Vector3>& vertices, double tolerance);

/// Triangulation of the polygon with these corners that has the least area, and among equals the shortest edges
/// [Barequet and Sharir 1995]; corners are numbered from 0, the orientation is the polygon's. Cubic in the number of
/// corners.
std::vector<Triangle> triangulate_polygon(const std::vector<Vector3>& corners);

/// The border loops of an oriented 2-manifold, each as vertices in the order in which a fill must run through them.
std::vector<std::vector<int>> border_loops(const SurfaceMesh& mesh);

/// Whether the triangle's height over its longest edge is under 1/1000 of that edge.
bool is_sliver(const SurfaceMesh& mesh, const Triangle& triangle);

/// Removes slivers of a closed oriented 2-manifold by collapsing an edge that is short for its triangle, or flipping
/// the longest edge, where that keeps a 2-manifold. Returns how many operations were made; slivers that resist remain.
/// `labels` holds one value per triangle and loses those of removed triangles. Vertices that fall out of use stay.
int remove_slivers(SurfaceMesh& mesh, std::vector<int>& labels);

struct Smoothing {
  int vertices;    // moved
  double movement; // m, the largest
};

/// Moves the vertices of triangles that pass through each other towards the mean of their neighbours, a tenth of the
/// way at a time, until none pass. Nothing, and the mesh as it was, when that takes more than `most_movement` m or 20
/// rounds.
std::optional<Smoothing> smooth_apart(SurfaceMesh& mesh, double most_movement);

/// Removes the vertices that no triangle uses; returns how many.
int remove_unused_vertices(SurfaceMesh& mesh);

} // namespace spherecut::topology
