// A triangulated part of a surface, in coordinates of its plane, with its border as given and graded inside.
#pragma once

#include "experiments/remeshing_ledger/scenario.hpp"

#include <vector>

namespace spherecut::experiments::ledger {

struct PatchRequest {
  std::vector<Vector2> points;                  // every one becomes a corner
  std::vector<std::array<int, 2>> outline;      // edges between points: closed loops, holes inside them
  std::vector<std::array<int, 2>> lines;        // edges inside
  std::function<double(const Vector2& p)> size; // m, of edges
};

struct Patch {
  std::vector<Vector2> points; // those asked for, then new ones inside
  std::vector<Triangle> triangles;
};

/// Constrained Delaunay triangles; no point is added on the outline or a line. Throws NumericalError where the outline
/// crosses itself or holds nothing.
Patch triangulate_patch(const PatchRequest& request);

} // namespace spherecut::experiments::ledger
