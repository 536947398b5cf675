// A body that follows the tool or a cut that was put off, made beside the steps: the body as it is goes on meanwhile.
#include "solvers/shapes/cut_sight.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/dropped_nodes.hpp"
#include "src/session/session.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <utility>

#include <sys/resource.h>

namespace spherecut::app {
namespace {

constexpr int aside_niceness = 5; // above that of the steps: where they share a core the steps go first

void yield_to_steps() {
  static_cast<void>(setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + aside_niceness)); // this thread's
}

} // namespace

void Session::set_following_aside(bool on) {
  following_aside_ = on;
  if (on)
    return;
  if (cuts_aside())
    take_cut();
  if (proposing_)
    drop_blade_proposal();
  drop_following();
}

// The contact has come so far from the middle of the fine zone that this must follow.
void Session::follow_aside(const StepSample& sample, const topology::SurfaceContact& centre) {
  if (!following_) {
    begin_following(next_zone(centre));
    return;
  }
  if (!leaves_zone(centre))
    return;
  take_following();
  rebuild_ = Rebuild::in_step;
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
    yield_to_steps();
    if (before.valid())
      before.wait(); // so that one computes at a time
    MadeAside made;
    BodyModel& model = made.model;
    model.incision = how.incision;
    model.sprinkling = resprinkle_held(scenario, *domain, how, previous);
    model.coarseness = coarseness;
    model.touched_from = centre.normal;
    const std::vector<int> near = touchable_nodes(scenario, *domain, model.sprinkling.nodes, centre, reach);
    app::assemble(scenario, domain, model, {}, near);
    app::condense(without_dropped(near, scenario, *model.body), model);
    find_lips(model);
    return made;
  };
  following_ = Following{centre, 0, 0, std::async(std::launch::async, std::move(make))};
}

// Where nothing but the blade, which may be ahead of its body, changes the tissue.
bool Session::follows_cuts_aside() const {
  return following_aside_ && !cut_appends(scenario_) && scenario_.blade &&
         scenario_.blade->advance.value_or(aside_advance) > 0 && blade_force_ == nullptr && !tears() &&
         !(scenario_.tool && scenario_.tool->grasp);
}

// m that the blade goes before its body follows.
double Session::advance() const {
  return scenario_.blade->advance.value_or(follows_cuts_aside() ? aside_advance : 0) * zone_.spacing.fine;
}

bool Session::may_cut_aside(const StepSample& sample) const {
  return follows_cuts_aside() && model_.state && !ends(sample);
}

// The body with this cut, on the nodes that a step would have made, rebuilt: no window pays that serves one increment.
std::future<Session::MadeAside> Session::make_beside(std::shared_ptr<const topology::Incision> incision,
                                                     const char* reason) {
  BodyModel next;
  next.incision = std::move(incision);
  const bool touches = tool_in_reach();
  const std::string renewed =
      model_.coarseness != coarseness_
          ? "the spacing has changed"
          : hindrance_to_growth(scenario_, model_, !unheld_pieces(incisions_->wound(), scenario_.fixed).empty());
  auto make = [&scenario = scenario_, domain = organ_.domain, how = sprinkle_options(next),
               incision_before = model_.incision, sprinkling = model_.sprinkling, renewed, reason,
               coarseness = coarseness_, centre = touches ? zone_contact_ : std::nullopt,
               reach = zone_.candidate_radius, facing = facing(), waits_for = std::move(unwanted_)]() mutable {
    yield_to_steps();
    if (waits_for.valid())
      waits_for.wait();
    MadeAside made;
    BodyModel& model = made.model;
    BodyUpdate& update = made.report;
    model.incision = how.incision;
    model.coarseness = coarseness;
    model.touched_from = facing;
    BodyModel before;
    before.incision = std::move(incision_before);
    before.sprinkling = std::move(sprinkling);
    double sight = 0, condensing = 0; // s, of the attempt that goes
    const auto build = [&](const auto& sprinkle) {
      update.seconds = {};
      condensing = 0;
      {
        const StageTimer timer(update.seconds.sprinkling);
        sprinkle();
      }
      std::vector<int> near;
      {
        const StageTimer timer(update.seconds.assembly);
        const double seen = solvers::sight_seconds();
        near = centre ? touchable_nodes(scenario, *domain, model.sprinkling.nodes, *centre, reach) : std::vector<int>{};
        app::assemble(scenario, domain, model, {}, near);
        sight = solvers::sight_seconds() - seen;
      }
      const StageTimer timer(condensing);
      app::condense(without_dropped(near, scenario, *model.body), model, true);
      find_lips(model);
    };
    update.update_reason = renewed;
    if (renewed.empty())
      try {
        build([&] { exchange_nodes(*domain, how, before, model.sprinkling); });
        update.update_reason = reason;
      } catch (const std::runtime_error& error) { // with all nodes made anew it may go
        update.update_reason = error.what();
        model.body.reset();
      }
    if (model.body == nullptr)
      build([&] { model.sprinkling = resprinkle_held(scenario, *domain, how, before.sprinkling.nodes); });
    report_body(model, sight, update);
    update.seconds.solve += condensing;
    return made;
  };
  return std::async(std::launch::async, std::move(make));
}

void Session::begin_cutting(std::shared_ptr<const topology::Incision> incision, double time, CutReport& report) {
  following_ = Following{std::nullopt, time, std::exchange(report.triangles, 0),
                         make_beside(std::move(incision), "the cut was put off")};
}

// Waits for it where need be. A failure leaves the body as it is: of a cut, that is refused; else it throws.
void Session::take_following() {
  if (cuts_aside()) {
    take_cut();
    return;
  }
  const topology::SurfaceContact centre = following_->centre.value();
  std::future<MadeAside> made = std::move(following_->made);
  following_.reset();
  BodyModel next = made.get().model;
  drop_recondensing();
  without_blade_.reset();
  kept_grip_ = remembered_grip();
  zone_contact_ = centre;
  zone_.spacing.centres = {centre.point};
  model_ = std::move(next);
  followed_aside_ = true;
  say_(fmt::format("the fine zone has followed the tool: {} nodes", model_.sprinkling.nodes.size()));
}

// The next step tells of it. Where its body could not be made the cut is refused.
void Session::take_cut() {
  Following following = std::move(*following_);
  following_.reset();
  shown_wound_.reset();
  CutReport& report = aside_cut_.emplace();
  try {
    MadeAside made = following.made.get();
    static_cast<BodyUpdate&>(report) = std::move(made.report);
    report.update = SystemUpdate::taken_over;
    report.triangles = following.triangles;
    rebuild_ = put_off_ < advance() * most_advances / 3 ? Rebuild::aside_early : Rebuild::aside;
    profile_.sprinkle += report.seconds.sprinkling;
    profile_.discretise += report.seconds.assembly + report.seconds.visibility;
    profile_.condense += report.seconds.solve;
    drop_recondensing();
    kept_grip_ = remembered_grip();
    model_ = std::move(made.model);
  } catch (const std::runtime_error& error) {
    incisions_->take_back();
    refuse_cut(following.time, error.what(), report);
  }
}

// The body has to be at its cut before this step goes on.
void Session::wait_for_cut(const StepSample& sample, CutReport& report) {
  take_cut();
  rebuild_ = Rebuild::in_step;
  if (!model_.state)
    grip_memory_ = std::exchange(kept_grip_, std::nullopt);
  solve(sample, model_);
  report.add(*std::exchange(aside_cut_, std::nullopt));
}

void Session::drop_following() {
  if (following_)
    unwanted_ = std::move(following_->made);
  following_.reset();
}

} // namespace spherecut::app
