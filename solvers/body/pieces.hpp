// Pieces of a cut body: nodes that couple among themselves alone, and what to do with those that nothing holds.
#pragma once

#include "solvers/body/discretisation.hpp"

namespace spherecut::solvers {

/// Connected components of a symmetric coupling graph in compressed rows, ordered by their first node, with what
/// `problem` holds of them.
std::vector<Piece> find_pieces(const Problem& problem, const std::vector<int>& start,
                               const std::vector<int>& neighbours);

/// Throws InputError naming the first piece that nothing holds, by its size and place.
void require_held(const std::vector<Piece>& pieces);

/// A spring between a node and the ground.
struct Anchor {
  int node = -1;
  Vector3 direction = Vector3::Zero(); // unit
};

/// Six springs on three nodes of the piece, far apart, that hold its rigid motions and nothing more: three on the
/// first, two across the line to the second, one across the plane with the third. Throws InputError when all nodes of
/// the piece lie on one line.
std::array<Anchor, 6> anchors_of(const Piece& piece, const NodeCloud& nodes);

} // namespace spherecut::solvers
