#include "src/session/finite_grip.hpp"

#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

void take_hold(const StepSample& sample, SessionState& state, Grasping& grasping) {
  BodyModel& model = state.model;
  if (model.finite == nullptr)
    make_finite(state, model);
  if (!model.solved())
    solve_finite(sample.time, std::nullopt, model, state.profile);
  Vector3 at_rest = sample.tool->point;
  try {
    at_rest = state.rest_of(at_rest);
  } catch (const NumericalError&) { // in front of the surface
  }
  Grasp grasp = grasping.reach_for(at_rest, *sample.tool, model, state.zone.fine());
  if (const std::optional<std::string> miss = grasping.miss(grasp, sample, model)) { // led by a hand
    state.log.warn("grip", *miss);
    return;
  }
  model.finite->take_hold(grasping.nodes_between(grasp, model, state.zone.fine()), *sample.tool);
  grasping.take(std::move(grasp));
}

} // namespace

bool follow_grip(const StepSample& sample, SessionState& state, Grasping& grasping) {
  const Grasping::Change change = grasping.change_at(sample, state.options.grip);
  if (change == Grasping::Change::closes)
    take_hold(sample, state, grasping);
  if (change != Grasping::Change::opens)
    return false;
  grasping.let_go();
  if (state.model.finite != nullptr)
    state.model.finite->let_go();
  return true;
}

} // namespace spherecut::app
