// What people bring, one named check each, in groups of a file each.
#pragma once

#include "experiments/experiment.hpp"

#include "src/scenario/scenario.hpp"
#include "src/session/session.hpp"

namespace spherecut::experiments::real_world {

/// A group of situations: its inputs are made in `context.out`, small, by itself.
using Group = std::vector<Check> (*)(const ExperimentContext& context);

/// Surfaces and label volumes as segmentations and programs leave them; methods on them.
std::vector<Check> organ_files(const ExperimentContext& context);
/// Walls, loads and sheets against closed forms.
std::vector<Check> organ_bodies(const ExperimentContext& context);
/// Cuts on nodes that nobody chose, against closed forms.
std::vector<Check> default_cracks(const ExperimentContext& context);
/// Slits of the surface against the same slit as a cut.
std::vector<Check> narrow_gaps(const ExperimentContext& context);

/// The last step of a scenario, from a text beside the files of the folder.
struct Outcome {
  app::StepResult last;
  int nodes = 0;
  double largest_displacement = 0; // m, of a node
  std::vector<std::string> warnings;
};
Outcome run_text(const ExperimentContext& context, const std::string& text);

/// The message with which a scenario is refused; empty where it is not.
std::string refusal_of(const ExperimentContext& context, const std::string& text);

} // namespace spherecut::experiments::real_world
