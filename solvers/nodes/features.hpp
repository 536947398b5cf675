// Sharp edges and corners of a tessellated surface, as curves to put nodes on.
#pragma once

#include "topology/surface/mesh.hpp"

namespace spherecut::solvers {

/// A run of sharp mesh edges between two corners, or a closed loop (first vertex repeated at the end, no corner).
struct SharpCurve {
  std::vector<int> vertices;             // of the mesh, in order
  std::vector<std::array<int, 2>> faces; // the two triangles of each segment
  std::vector<bool> convex;              // per segment: the body's angle is below 180 degrees
  bool closed = false;
  int component = 0; // curves of one connected set of sharp edges share this number
};

struct SharpFeatures {
  std::vector<int> corners;                       // mesh vertices
  std::vector<int> corner_component;              // as SharpCurve::component
  std::vector<std::vector<int>> corner_triangles; // of both sides of each sharp edge there (faces may repeat)
  std::vector<SharpCurve> curves;
  int components = 0;
};

/// Mesh edges whose two triangles' normals differ by more than sharp_degrees, chained. Corners are the vertices where
/// other than two sharp edges meet or where the chain turns by more than 60 degrees. Linear in the number of triangles.
SharpFeatures find_sharp_features(const topology::SurfaceMesh& mesh, double sharp_degrees);

} // namespace spherecut::solvers
