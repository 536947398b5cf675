// The cube with a disc-shaped cut, tilted and shifted against it, of several experiments.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/precut_series.hpp"

namespace spherecut::experiments {

constexpr double penny_radius = 1; // m

/// Frame of the cut: its centre and normal, and a direction in its plane. The cube of 4 m is about the origin.
CutFrame penny_frame(Placement placement = Placement::tilted);

/// About `nodes` nodes, E = 1 Pa; supports and loads are the caller's.
CutBody penny_body(int nodes, std::uint64_t seed, double nu, const PrecutMethod& method,
                   Placement placement = Placement::tilted);

} // namespace spherecut::experiments
