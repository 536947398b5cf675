// The run functions of the experiments that compare with what others measured on tissue and its models.
#pragma once

#include "experiments/experiment.hpp"

namespace spherecut::experiments {

std::vector<Check> run_truth_cube(const ExperimentContext& context);
std::vector<Check> run_liver_blade(const ExperimentContext& context);
std::vector<Check> run_push_slice(const ExperimentContext& context);
std::vector<Check> run_wire_cutting(const ExperimentContext& context);
std::vector<Check> run_skin_wound(const ExperimentContext& context);

} // namespace spherecut::experiments
