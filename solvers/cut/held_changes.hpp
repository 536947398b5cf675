// Means over the held surface of a body whose nodes and cut change, and what differs between two of its states.
#pragma once

#include "solvers/body/surface_patches.hpp"
#include "solvers/shapes/cut_reach.hpp"

namespace spherecut::solvers {

/// The surface shared out among the present nodes, as the ordinary discretisation does it.
struct Shares {
  NodeCloud nodes;
  std::vector<int> compact; // place of each node of the problem in `nodes`
  SurfacePatches patches;

  Shares(const Problem& problem, const std::vector<char>& removed,
         const std::optional<SurfacePatches::Part>& part = std::nullopt,
         SurfacePatches::Of of = SurfacePatches::Of::skin_and_faces);
};

/// What each prescribed entry holds, as the ordinary discretisation takes it.
std::vector<DisplacementMean> held_means(const Problem& problem, const Spheres& spheres, const Shares& shares);

/// Whether two means differ by no more than the order of summation.
bool equal_to_rounding(const DisplacementMean& a, const DisplacementMean& b);

/// A held mean that the two do not have in common: from one it has to go, to the other it has to come.
struct HeldChange {
  int before = -1, now = -1; // entries, -1: none
};

/// In the order of the entries now, then those that have gone.
std::vector<HeldChange> held_changes(const std::vector<Prescribed>& before, const std::vector<DisplacementMean>& old,
                                     const std::vector<Prescribed>& now, const std::vector<DisplacementMean>& held);

} // namespace spherecut::solvers
