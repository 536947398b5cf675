// How thick the walls of a body are, and how wide the gaps between parts of its own surface.
#pragma once

#include "topology/surface_mesh.hpp"

namespace spherecut::topology {

/// Width of a wall or gap where a ray from a place of the surface, along its normal, meets the surface again.
struct WidthSample {
  Vector3 point = Vector3::Zero(); // m, half way
  double width = 0;                // m
  double area = 0;                 // m2 of the surface that the ray stands for
  bool is_parallel = false;        // the two places face each other within 25 degrees: a plate, a shell, a slit
};

struct SurfaceWidths {
  std::vector<WidthSample> walls, gaps; // rays into the body, and out of it
};

/// Rays from points of the surface about `apart` m from one another (at most 40000, then farther), inwards as far as
/// they go and outwards up to `reach` m. The mesh is closed and outward. Deterministic.
SurfaceWidths surface_widths(const SurfaceMesh& mesh, double apart, double reach);

/// Samples whose width is below `width`, parallel, and which are no rim or margin: within four times that most of
/// the surface (three quarters) is as thin. Indices, ascending.
std::vector<int> thin_samples(const std::vector<WidthSample>& samples, double width);

} // namespace spherecut::topology
