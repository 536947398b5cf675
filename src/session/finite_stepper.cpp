#include "src/session/finite_stepper.hpp"

#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words)
    all += (all.empty() ? "" : ", ") + word;
  return all;
}

} // namespace

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
  if (state_.model.finite == nullptr) {
    make_finite(state_, state_.model);
    if (state_.touch && free_pose_ &&
        !has_loads(state_.scenario)) // from there a step goes, should it have to be halved
      solve_finite(free_time_, free_pose_, state_.model, state_.profile);
  }
  contact_.solve(sample, state_.model);
  return true;
}

// Loads act whole from the first solution on. Later ones are driven by what moves alone.
std::string without_equilibrium(const SessionState& state, double time, bool is_cutting, const NumericalError& error) {
  const Scenario& scenario = state.scenario;
  const bool is_led = state.leader == Leader::path;
  const bool is_first = state.model.finite == nullptr || !state.model.finite->solved();
  const bool is_pressed = has_grasper(scenario) || (state.touch && state.contact && state.contact->depth > 0);
  std::vector<std::string> loads, movers, steps, spacings;
  for (std::size_t k = 0; is_first && k < scenario.precuts.size(); ++k)
    if (const double pressure = scenario.precuts[k].pressure; pressure != 0)
      loads.push_back(fmt::format("precut[{}].pressure = {:g} Pa", k + 1, pressure));
  if (is_first && scenario.gravity)
    loads.emplace_back("gravity.acceleration");
  if (is_first && !scenario.pretension.isZero(0))
    loads.emplace_back("material.pretension");
  if (scenario.tool && is_pressed) {
    movers.emplace_back("the tool");
    steps.emplace_back("tool.step");
    spacings.emplace_back("nodes.fine_spacing");
  }
  if (is_cutting) {
    movers.emplace_back("the blade");
    steps.emplace_back("blade.step");
  }
  if (has_cuts(scenario))
    spacings.emplace_back("cut.front_spacing");
  if (spacings.empty())
    spacings.emplace_back("nodes.coarse_spacing");
  std::vector<std::string> all = loads;
  all.insert(all.end(), movers.begin(), movers.end());
  std::string help;
  if (!loads.empty())
    help += fmt::format("{} whole at once: less of {}, or a stiffer material, may have an equilibrium. ",
                        loads.size() == 1 ? "A load acts" : "Loads act", loads.size() == 1 ? "it" : "them");
  if (!movers.empty())
    help += fmt::format("{} too long for the law do that{}. ", loads.empty() ? "Steps" : "Steps of what moves",
                        is_led ? fmt::format(" ({})", joined(steps)) : std::string());
  return fmt::format("t = {:g} s: {}. {}{}Nodes too coarse do that, too ({})", time, error.what(),
                     all.empty() ? std::string() : fmt::format("The body is driven by {}. ", joined(all)), help,
                     joined(spacings));
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
