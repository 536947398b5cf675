// A blade pushed into a block that is there cut to every depth: the first cut, and a whole cut piece by piece.
#pragma once

#include "experiments/support/cutting_block.hpp"

#include <span>

namespace spherecut::experiments {

struct Knife {
  double toughness = 0; // J/m2
  double sharpness = 1;
  double stroke = 0.05; // m, of the blade between two looks
  double reach = 2;     // m, the blade is no farther than that ahead of the cut
};

struct Rupture {
  std::size_t cut = 0;          // which of the lengths offered
  double length = 0, blade = 0; // m, of the cut; how far the blade has gone ahead
  double force = 0;             // N, on the edge against its way ahead
};

/// The first cut: of all lengths, the one whose energy is there first. Throws NumericalError when none is within reach.
Rupture first_rupture(const CuttingCase& block, const CuttingBody& uncut, std::span<const CuttingBody> cuts,
                      const Knife& knife);

/// From the first touch, or from the front of a cut that is there, to a depth.
struct CuttingRun {
  std::vector<double> blade, force; // m, N: how far the blade has gone ahead, its force against that
  // Means over the way of the blade while the front is far from both ends, N: against its way ahead, along its edge.
  double steady = 0, steady_along = 0;
  double lag = 0;                                                 // m, mean of the blade ahead of the cut there
  double rupture_force = 0, rupture_blade = 0, after_rupture = 0; // N, m, N
  solvers::BladeLedger ledger;
};

/// Cuts from the depth of each body to that of the next, at first to that of body `first`; the blade begins at the
/// depth of the first body. The means begin with the first cut that starts at `steady_from` (m) or beyond. Throws
/// NumericalError when the blade goes out of reach.
CuttingRun run_blade(const CuttingCase& block, std::span<const CuttingBody> bodies, const Knife& knife,
                     double steady_from, std::size_t first = 1);

} // namespace spherecut::experiments
