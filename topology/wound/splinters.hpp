// Splinters of a cut: what is left between strips of it that all but coincide, as where a blade turns in its way, or
// where the body has moved between one increment and the next. They are no tissue: no node sees into them.
#pragma once

#include "topology/wound/wound.hpp"

#include <vector>

namespace spherecut::topology {

struct PieceShape {
  double size = 0;                  // m, 6 volume / area: the diameter of a ball of that ratio; 0 without area
  Vector3 middle = Vector3::Zero(); // of its surface, m
};

/// Of every piece of a wound.
std::vector<PieceShape> piece_shapes(const Wound& wound);

/// The wound without its splinters, the pieces of a size below `thinnest`, m, but for the largest piece: their
/// components, triangles and vertices are left out, what is left keeps its order and stays closed and 2-manifold.
/// Nothing when there are none.
std::optional<Wound> without_splinters(const Wound& wound, double thinnest);

} // namespace spherecut::topology
