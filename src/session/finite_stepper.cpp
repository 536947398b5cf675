#include "src/session/finite_stepper.hpp"

#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {

bool FiniteStepper::solve(const StepSample& sample, bool is_solved, bool is_met) {
  const bool touches = state_.touch && state_.contact && state_.contact->depth > 0;
  const bool begins = has_loads(state_.scenario) || touches || is_met || state_.model.incision != nullptr;
  if (state_.model.finite == nullptr && !begins) {
    free_pose_ = sample.tool;
    free_time_ = sample.time;
    return false;
  }
  if (is_solved)
    return true;
  interruption_point();
  try {
    if (state_.model.finite == nullptr) {
      make_finite(state_, state_.model);
      if (state_.touch && free_pose_ &&
          !has_loads(state_.scenario)) // from there a step goes, should it have to be halved
        solve_finite(free_time_, free_pose_, state_.model, state_.profile);
    }
    contact_.solve(sample, state_.model);
  } catch (const NumericalError& error) {
    throw NumericalError(told(sample, error));
  }
  return true;
}

std::string FiniteStepper::told(const StepSample& sample, const NumericalError& error) const {
  const bool is_led = state_.leader == Leader::path;
  return fmt::format("t = {:g} s: {}. {}What a law cannot bear does that, or steps too long for it{}, or nodes too "
                     "coarse for the tool (nodes.fine_spacing)",
                     sample.time, error.what(), is_led ? "The rows up to then are kept. " : "",
                     is_led ? " (tool.step)" : "");
}

std::vector<Vector3> places_of_contact(const SessionState& state) {
  std::vector<Vector3> places{state.zone.centre()->point};
  if (state.scenario.tool->grasp) // it touches where it takes hold
    return places;
  const double pitch = state.scenario.contact.follow_fraction * state.zone.spacing().radius;
  for (const StepSample& sample : state.steps) {
    if (!sample.tool)
      continue;
    const topology::SurfaceContact contact = state.query.first_touch(state.scenario.tool->shape, *sample.tool);
    const Vector3 place = state.zone.centre_of(contact, *sample.tool).point;
    if (contact.depth > 0 && std::none_of(places.begin(), places.end(),
                                          [&](const Vector3& known) { return (known - place).norm() <= pitch; }))
      places.push_back(place);
  }
  return places;
}

} // namespace spherecut::app
