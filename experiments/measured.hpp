// The run functions of the experiments that compare with what others measured on tissue and its models.
#pragma once

#include "experiments/experiment.hpp"

namespace spherecut::experiments {

std::vector<Check> run_truth_cube(const ExperimentContext& context);

} // namespace spherecut::experiments
