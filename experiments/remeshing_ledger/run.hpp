// The experiment's run function.
#pragma once

#include "experiments/experiment.hpp"

namespace spherecut::experiments {

std::vector<Check> run_remeshing_ledger(const ExperimentContext& context);

} // namespace spherecut::experiments
