#include "src/tissue/options.hpp"

#include "src/model/body_model.hpp"
#include "src/scenario/law_reader.hpp"

namespace spherecut::app {

bool resists(const Scenario& scenario) {
  return scenario.blade && scenario.toughness != 0;
}

bool has_cuts(const Scenario& scenario) {
  return scenario.blade || !scenario.precuts.empty() || scenario.tearing.enabled;
}

bool has_loads(const Scenario& scenario) {
  return scenario.gravity || !scenario.pretension.isZero();
}

bool has_grasper(const Scenario& scenario) {
  return scenario.tool && scenario.tool->grasp;
}

// Beside the steps a body is made where nothing but the blade, which may be ahead of it, changes the tissue.
CutPolicy cut_policy(const Scenario& scenario, const SessionOptions& options) {
  if (!scenario.blade)
    return CutPolicy::none;
  const bool blade_alone = !scenario.tearing.enabled && !has_grasper(scenario);
  const std::optional<double>& advance = scenario.blade->advance;
  if (resists(scenario))
    return options.following_in_background && blade_alone && !advance ? CutPolicy::proposed_in_background
                                                                      : CutPolicy::proposed;
  if (options.following_in_background && blade_alone && advance.value_or(background_advance) > 0)
    return CutPolicy::in_background;
  return CutPolicy::in_step;
}

double blade_advance(const Scenario& scenario, const SessionOptions& options) {
  const bool is_in_background = cut_policy(scenario, options) == CutPolicy::in_background;
  return scenario.blade->advance.value_or(is_in_background ? background_advance : 0);
}

} // namespace spherecut::app
