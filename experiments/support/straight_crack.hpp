// The block with a straight crack, tilted and shifted against it, of several experiments.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "experiments/support/cut_body.hpp"

namespace spherecut::experiments {

/// Frame of the crack: it runs through the block of 2 x 1 x 2 m about the origin.
CutFrame straight_crack_frame(Placement placement = Placement::tilted);

/// The block with E = 1 Pa and nu = 0.3, about 350 nodes; supports are the caller's. `edge` m: of the sheet's
/// triangles.
CutBody straight_crack_body(std::uint64_t seed, double edge, solvers::Method method,
                            solvers::SightRule sight = solvers::SightRule::enriched,
                            Placement placement = Placement::tilted);

} // namespace spherecut::experiments
