// How a session sets out: the tool's way, the moments of the run, precuts, and the first nodes.
#pragma once

#include "src/tissue/body_updater.hpp"

namespace spherecut::app {

/// Finds the tool's way and its first touch, and so the steps; makes the precuts; warns of what is odd. Throws
/// InputError.
void set_out(SessionState& state, Leader leader);

/// The fine zone and the first nodes of a session that has something to compute. Throws InputError where pieces, walls
/// or fixed regions are too small for the nodes, and as require_first_steps().
void lay_first_nodes(SessionState& state, const BodyUpdater& updater);

/// The way of an approach counts from its first touch of the body as its loads hold it before the tool comes: builds
/// and solves that, and finds the steps anew. False: there is no such approach, nothing is done.
bool approach_hanging(SessionState& state, BodyUpdater& updater);

} // namespace spherecut::app
