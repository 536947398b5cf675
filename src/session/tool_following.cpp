#include "src/session/tool_following.hpp"

#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double allowed_force_jump = 0.02; // at a re-sprinkle

} // namespace

void ToolFollowing::follow(const StepSample& sample, const topology::SurfaceContact& centre, StepResult& result) {
  const Vector3 before = state_.model.state->tool.tool_force;
  state_.log.say(fmt::format("the fine zone follows the tool, t = {:g} s", sample.time));
  state_.rebuild = Rebuild::in_step;
  const topology::SurfaceContact stays = *state_.zone.centre();
  state_.zone.move_to(state_.zone.next_centre(centre));
  BodyModel next;
  next.touched_from = state_.zone.facing();
  next.incision = state_.model.incision;
  try {
    updater_.sprinkle(&state_.model.sprinkling.nodes, next);
    updater_.build(next);
    contact_.solve(sample, next);
  } catch (const NumericalError& error) {
    if (state_.leader == Leader::path)
      throw;
    state_.zone.move_to(stays);
    say_not_followed(error);
    return;
  }
  state_.model = std::move(next);
  result.resprinkled = true;
  const Vector3& after = state_.model.state->tool.tool_force;
  result.force_jump = before.norm() > 0 ? (after - before).norm() / before.norm() : 0;
  if (result.force_jump > allowed_force_jump)
    state_.log.warn(
        state_.options.force_only ? "jump" : fmt::format("jump at {:g} s", sample.time),
        fmt::format("the force jumped by {:.1f} % at a re-sprinkle (t = {:g} s); finer nodes or a larger fine "
                    "radius bring it under {:g} %",
                    100 * result.force_jump, sample.time, 100 * allowed_force_jump));
}

// The nodes as they are go on.
void ToolFollowing::say_not_followed(const std::exception& error) {
  state_.log.warn("not followed", fmt::format("the fine zone has not followed the tool: {}", error.what()));
}

void ToolFollowing::follow_in_background(const StepSample& sample, const topology::SurfaceContact& centre) {
  if (!background_.is_following()) {
    const topology::SurfaceContact next = state_.zone.next_centre(centre);
    background_.follow({next}, updater_.following_tool(next));
    return;
  }
  if (!state_.zone.is_left_by(centre))
    return;
  take();
  state_.rebuild = Rebuild::in_step;
  contact_.solve(sample, state_.model);
}

void ToolFollowing::take() {
  auto [following, body] = background_.take_following();
  BodyModel next = body.get().model;
  try {
    take_over_finite(state_.model, next, state_.profile);
  } catch (const NumericalError& error) {
    say_not_followed(error);
    return;
  }
  contact_.keep_grip();
  state_.zone.move_to(*following.centre);
  state_.model = std::move(next);
  taken_ = true;
  state_.log.say(fmt::format("the fine zone has followed the tool: {} nodes", state_.model.sprinkling.nodes.size()));
}

} // namespace spherecut::app
