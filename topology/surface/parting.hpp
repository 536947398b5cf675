// Edges with more than two faces and vertices where several fans of triangles meet, made 2-manifold by parting them.
#pragma once

#include "topology/surface/mesh.hpp"

#include <string>

namespace spherecut::topology {

/// Which faces of an edge with more than two of them belong together.
enum class PartedBy : std::uint8_t {
  material, // the two that bound the same wedge of a body: it hangs together through faces, never through an edge
  flatness, // the two that continue each other best: sheets that cross, or end on another
};

/// An edge with more than two faces that cannot be parted.
struct AmbiguousEdge {
  int low, high;       // vertices
  int faces, triangle; // how many, and one of them
};

struct Parting {
  int edges = 0;                        // that had more than two faces
  int vertices = 0;                     // that were doubled
  double movement = 0;                  // m, largest, by which copies were moved off each other
  std::vector<AmbiguousEdge> ambiguous; // where there is one, the surface is of no use
};

/// Parts the surface. `labels` holds one value per triangle and is kept in step. By material, faces around an edge
/// have to bound material and void in turn, as those of a consistently oriented surface do (outwards or inwards as a
/// whole); any other edge is ambiguous. Copies of a vertex are then moved by a thousandth of the way to the mean of
/// their neighbours, all but the one about which the surface is flattest, so that the surface does not touch itself.
/// By flatness nothing moves, and one face of an odd number keeps a border there.
Parting part_surface(SurfaceMesh& mesh, std::vector<int>& labels, PartedBy by);

} // namespace spherecut::topology
