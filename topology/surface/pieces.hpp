// The separate components of a surface: pieces of a body, and cavities within them.
#pragma once

#include "topology/surface/mesh.hpp"

namespace spherecut::topology {

/// Triangles that hang together by their vertices.
struct SurfaceComponent {
  int triangles = 0;
  int first = 0;                    // its first triangle
  double volume = 0;                // m3, signed by its own orientation; about that, where it has holes
  Vector3 middle = Vector3::Zero(); // m, of its vertices
  BoundingBox box{};                // m
  std::vector<int> within;          // components that enclose it, ascending
  /// Whether it bounds a cavity: it lies within an odd number of others.
  [[nodiscard]] bool is_cavity() const { return within.size() % 2 == 1; }
};

struct SurfaceComponents {
  std::vector<SurfaceComponent> components; // by falling volume, whatever its sign
  std::vector<int> of;                      // per triangle
};

/// What is within what is told by the winding number of the outer component about vertices of the inner one.
SurfaceComponents find_components(const SurfaceMesh& mesh);

} // namespace spherecut::topology
