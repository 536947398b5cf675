// What people bring to a live session: groups of situations, one named check each.
#pragma once

#include "experiments/experiment.hpp"

namespace spherecut::experiments {

namespace real_world {

/// Clients that send fewer poses a second than the loop ticks, with jitter, loss and reordering.
std::vector<Check> slow_clients(const ExperimentContext& context);
/// A device that presses where the scenario's path never goes.
std::vector<Check> device_elsewhere(const ExperimentContext& context);
/// Numbers, texts, files and signals from outside.
std::vector<Check> disorder(const ExperimentContext& context);

} // namespace real_world
} // namespace spherecut::experiments
