// Nodes that follow the tool, with their body, made beside the steps: the body as it is goes on meanwhile.
#include "src/session.hpp"

#include <fmt/format.h>
#include <utility>

namespace spherecut::app {

void Session::set_following_aside(bool on) {
  following_aside_ = on;
  if (!on)
    drop_following();
}

// The contact has come so far from the middle of the fine zone that this must follow.
void Session::follow_aside(const StepSample& sample, const topology::SurfaceContact& centre) {
  if (!following_) {
    begin_following(next_zone(centre));
    return;
  }
  if ((centre.point - zone_contact_->point).norm() <= zone_.spacing.radius)
    return;
  take_following();
  solve(sample, model_);
}

void Session::begin_following(const topology::SurfaceContact& centre) {
  const auto contact = std::exchange(zone_contact_, centre);
  auto centres = std::exchange(zone_.spacing.centres, {centre.point});
  solvers::SprinkleOptions options = sprinkle_options(model_);
  zone_contact_ = contact;
  zone_.spacing.centres = std::move(centres);
  auto make = [&scenario = scenario_, domain = organ_.domain, how = std::move(options),
               previous = model_.sprinkling.nodes, coarseness = coarseness_, centre, reach = zone_.candidate_radius,
               before = std::move(unwanted_)]() mutable {
    if (before.valid())
      before.wait(); // so that one computes at a time
    BodyModel made;
    made.incision = how.incision;
    made.sprinkling = resprinkle_held(scenario, *domain, how, previous);
    made.coarseness = coarseness;
    const std::vector<int> near = touchable_nodes(scenario, *domain, made.sprinkling.nodes, centre, reach);
    app::assemble(scenario, domain, made, {}, near);
    app::condense(near, made);
    return made;
  };
  following_ = Following{centre, std::async(std::launch::async, std::move(make))};
}

// Waits for it where need be. A failure leaves the body as it is.
void Session::take_following() {
  Following following = std::move(*following_);
  following_.reset();
  BodyModel next = following.made.get();
  drop_recondensing();
  without_blade_.reset();
  kept_grip_ = remembered_grip();
  zone_contact_ = following.centre;
  zone_.spacing.centres = {following.centre.point};
  model_ = std::move(next);
  followed_aside_ = true;
  say_(fmt::format("the fine zone has followed the tool: {} nodes", model_.sprinkling.nodes.size()));
}

void Session::drop_following() {
  if (following_)
    unwanted_ = std::move(following_->made);
  following_.reset();
}

} // namespace spherecut::app
