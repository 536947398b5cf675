// Places where the surface of the deformed body has come to itself: banks of a fissure, lobes, fingers.
#pragma once

#include "solvers/contact/lip_contact.hpp"

namespace spherecut::solvers {

struct BankPairs {
  std::vector<LipPair> pairs;   // with their gap at rest
  std::vector<double> openings; // m, of each as the nodes are displaced; negative: the banks have passed through
};

/// Pairs of nodes of the organ's own surface that face each other across a gap at rest and whose distance along the
/// normal is below `near` spacings now, nodes displaced by `displacement` (3 a node, m). Each node is paired with the
/// one that it faces now, the nearest at rest where there are several; no pairs close a ring, so that their forces are
/// told apart. A convex body has none. Normals are those at rest.
BankPairs bank_pairs(const NodeCloud& nodes, const VectorX& displacement, double near);

/// Those pairs, and of `more` those that close no ring with pairs before them. `nodes`: how many there are.
std::vector<LipPair> joined_without_rings(std::vector<LipPair> pairs, const std::vector<LipPair>& more, int nodes);

} // namespace spherecut::solvers
