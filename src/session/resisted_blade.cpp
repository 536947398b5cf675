#include "src/session/resisted_blade.hpp"

#include "src/base/stage_timer.hpp"
#include "src/model/finite_model.hpp"
#include "src/tissue/cut_checks.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double most_overload = 5; // times of what a cut takes, that the edge may release without one
constexpr int overloads_told = 3;   // steps on end

BladeEdge edge_of(const SessionState& state) {
  const auto map_of = [&state](const BodyModel& model) {
    return [&state, &model](const Vector3& x) {
      return rest_position(x, model, *state.organ.domain, state.zone.spacing());
    };
  };
  return {state.scenario, state.organ.domain, state.zone.fine(), map_of, toughness_field(state.scenario)};
}

} // namespace

ResistedBlade::ResistedBlade(SessionState& state, const BladeTrack& blade, ContactSolver& contact,
                             BackgroundBodies& background, BodyUpdater& updater, const TearFronts& fronts)
    : state_(state), blade_(blade), contact_(contact), background_(background), updater_(updater), fronts_(fronts),
      force_(state.scenario, edge_of(state)) {
  if (force_.edge().finer_than_nodes())
    state_.log.warn(
        "edge", fmt::format("the contact of the blade's edge is narrower than the nodes; it is taken as {:.3g} m wide: "
                            "before it cuts, the blade sinks in less than it would",
                            2 * force_.edge().half_width()));
}

bool ResistedBlade::enters(const StepSample& sample) const {
  return sample.blade && force_.edge().inside(*sample.blade, state_.model);
}

void ResistedBlade::load_body() {
  solvers::Field bladed = force_.field(state_.model);
  state_.model.without_blade = std::exchange(state_.model.field, std::move(bladed));
  if (state_.model.finite != nullptr)
    state_.model.finite->show_pressed(force_.presses());
}

void ResistedBlade::load_grasper(solvers::ContactState& grasper, const topology::ToolPose& pose) const {
  const VectorX forces = force_.on_held();
  const std::vector<Vector3>& rest = state_.model.patch.rest;
  if (forces.size() == 0 || forces.size() != 3 * std::ssize(rest))
    return;
  grasper.tool_force.setZero();
  grasper.tool_torque.setZero();
  for (std::size_t c = 0; c < rest.size(); ++c) {
    const auto at = 3 * static_cast<Eigen::Index>(c);
    grasper.nodal_forces[c] = forces.segment<3>(at);
    grasper.tool_force -= grasper.nodal_forces[c];
    grasper.tool_torque -= (rest[c] + grasper.displacement.segment<3>(at) - pose.point).cross(grasper.nodal_forces[c]);
  }
}

void ResistedBlade::lift() {
  force_.lift();
  if (state_.model.finite != nullptr)
    state_.model.finite->leave_edge();
  drop_proposal();
}

void ResistedBlade::drop_proposal() {
  background_.drop_proposing();
  if (mark_)
    state_.incisions->go_back(*mark_);
  forget_mark();
}

void ResistedBlade::withdraw() {
  force_.withdraw();
  drop_proposal();
}

void ResistedBlade::forget_mark() {
  mark_.reset();
  state_.shown_wound.reset();
}

bool ResistedBlade::proposes_in_background() const {
  return cut_policy(state_.scenario, state_.options) == CutPolicy::proposed_in_background;
}

double ResistedBlade::press(const StepSample& sample, CutReport& report) {
  if (sample.blade)
    return press_at(sample, report);
  const bool has_moved = state_.model.finite != nullptr ? !state_.model.finite->is_pressed() // the tool has
                                                        : !force_.is_gripped_as(state_.model);
  if (force_.presses() && has_moved) {
    drop_proposal();
    force_.meet_again(state_.model);
  }
  if (!blade_.last() || !(background_.proposing() != nullptr || lags_in_background()))
    return 0;
  StepSample left = sample; // at the end of its path, with a cut still to come
  left.blade = blade_.last();
  left.blade->time = sample.time;
  return press_at(left, report);
}

// The energy of the surface that the blade makes on its way to the sample's pose, J.
double ResistedBlade::press_at(const StepSample& sample, CutReport& report) {
  follow_tool(sample);
  const topology::RestMap to_rest = state_.to_rest();
  std::vector<topology::BladePose> passed = blade_.passed();
  const bool placed = !force_.way().empty();
  const bool out =
      !force_.edge().inside(*sample.blade, state_.model); // what it pushes ahead of itself there is cut in the step
  double surface = 0;
  if (placed) {
    const bool leaves = !force_.meets(*sample.blade, state_.model);
    while (leaves && !passed.empty() && !force_.meets(passed.back(), state_.model))
      passed.pop_back();
    const bool goes_on = leaves && !passed.empty(); // before it leaves
    if (goes_on)
      force_.go_to(passed, state_.model);
    else
      force_.pass_by(passed);
    const double far = most_advances * background_advance * state_.zone.fine();
    if (const BackgroundBodies::Proposing* made = background_.proposing();
        made != nullptr &&
        (background_.has_arrived() || leaves || out || force_.way().left(force_.edge()) - made->way_left > far))
      take(sample, report);
    const bool lags = proposes_in_background() && (force_.proposed() || force_.lags());
    if (goes_on || (leaves && lags)) // what it has come to is cut before
      surface += cut_on(sample, false, report);
  }
  force_.go_to({&*sample.blade, 1}, state_.model);
  if (!force_.meets(*sample.blade, state_.model)) {
    leave(sample);
    state_.incisions->place(*sample.blade, to_rest);
    return surface;
  }
  if (!placed)
    state_.incisions->place(*sample.blade, to_rest);
  surface += cut_on(sample, proposes_in_background() && !out, report);
  watch_overload(sample.time, surface > 0);
  return surface;
}

// An edge that releases more in step after step is held by tissue whose cut is refused, or is not found.
void ResistedBlade::watch_overload(double time, bool has_cut) {
  const double times = force_.overload();
  if (has_cut || background_.proposing() != nullptr || times <= most_overload) {
    overloads_ = 0;
    return;
  }
  if (++overloads_ < overloads_told)
    return;
  state_.log.warn("overload",
                  fmt::format("t = {:g} s: the blade's edge releases {:.2g} times what its cut takes (most: "
                              "{:g}), and the cut does not come: its force of {:.3g} N is not that of this "
                              "toughness. Smaller steps (blade.step) or finer nodes (cut.front_spacing) "
                              "may find the cut",
                              time, times, most_overload, force_.report().force.norm()));
}

// A proposal is solved with the tool as it was: where that touches or holds, and is elsewhere now, it is solved again.
// One that is being made is solved when it is there. Where the tool has come or gone it is dropped.
void ResistedBlade::follow_tool(const StepSample& sample) {
  const bool touches = contact_.is_in_reach();
  const bool comes_or_goes = touches != touched_;
  const bool moves =
      touches && tool_ && sample.tool && (tool_->point != sample.tool->point || tool_->axis != sample.tool->axis);
  touched_ = touches;
  tool_ = sample.tool;
  if (comes_or_goes && (force_.proposed() || background_.proposing() != nullptr)) {
    withdraw();
  } else if (moves && force_.proposed()) {
    try {
      force_.solve_proposal([&](BodyModel& body) { contact_.solve_beside(sample, body); });
    } catch (const std::runtime_error&) { // another is made where it is wanted
      withdraw();
    }
  }
}

// What it has passed without a cut is told.
void ResistedBlade::leave(const StepSample& sample) {
  if (const double uncut = force_.passed_uncut(state_.model); uncut > 0)
    state_.log.warn("bridge",
                    fmt::format("by t = {:g} s the blade has left the organ past up to {:.2g} mm of tissue that it has "
                                "not cut. Nearer than a node spacing ({:.2g} mm) to a surface or a fixed region the "
                                "nodes do not tell what its edge releases: finer ones (nodes.fine_spacing, "
                                "cut.front_spacing) cut farther; what it passes within a step it does not meet: a "
                                "smaller blade.step does",
                                sample.time, 1e3 * uncut, 1e3 * state_.zone.fine()));
  force_.leave();
  if (state_.model.finite != nullptr)
    state_.model.finite->leave_edge();
  drop_proposal();
}

// What else loads the body pays for a part of the cut.
void ResistedBlade::look_at_loads(double time) {
  const std::vector<FrontPlace> places = force_.places_at_front();
  const std::optional<double> known = fronts_.released(state_.model, places);
  const double release = known.value_or(0);
  force_.draw_on(release);
  if (!known)
    state_.log.warn("release",
                    fmt::format("t = {:g} s: the front that the blade is at is too near the surface for its "
                                "stress intensities: what the loads release there pays for no part of the cut",
                                time));
  if (const double toughness = places.empty() ? 0 : force_.toughness();
      !state_.scenario.tearing.enabled && !places.empty() && release >= toughness)
    state_.log.warn("ahead",
                    fmt::format("t = {:g} s: the loads alone release {:.3g} J/m2 at the front that the blade is "
                                "at, of a toughness of {:.3g}: it would run ahead of the blade, which [tearing] "
                                "lets it do. Without that it goes along with the blade, which needs no force",
                                time, release, toughness));
}

// A cut is built when it comes near, beside the body, and the body becomes it when it is due. Where it is built beside
// the steps the blade waits at the force of steady cutting: what it does is then what it would have done, only later.
// The energy of the surface, J.
double ResistedBlade::cut_on(const StepSample& sample, bool in_background, CutReport& report) {
  int triangles = report.triangles;
  double surface = 0;
  look_at_loads(sample.time);
  bool waits = false; // what takes a body over leaves the next one to the next step
  for (;;) {
    waits = waits || background_.proposing() != nullptr;
    if (const std::vector<topology::BladePose> poses =
            waits ? std::vector<topology::BladePose>{} : force_.wanted(state_.model);
        !poses.empty()) {
      if (!mark_) {
        mark_ = state_.incisions->mark();
        state_.shown_wound = state_.incisions->wound();
      }
      if (in_background && force_.proposed()) { // a longer cut in its place
        force_.withdraw();
        state_.incisions->go_back(*mark_);
        continue;
      }
      if (in_background) {
        build_in_background(poses, sample, report);
      } else if (propose(poses, sample, report)) {
        triangles += report.triangles;
      }
      if (!force_.proposed() && background_.proposing() == nullptr) { // nothing is cut there
        forget_mark();
        force_.pass(poses.size(), state_.model);
        continue;
      }
    }
    if ((waits || background_.proposing() != nullptr) && !force_.proposed()) {
      force_.wait(state_.model);
      break;
    }
    if (!force_.advance(state_.model))
      break;
    BladeForce::Taken taken = force_.take();
    surface += taken.surface;
    state_.model = std::move(taken.body);
    look_at_loads(sample.time);
    forget_mark();
    waits = in_background;
  }
  report.triangles = triangles;
  return surface;
}

// The incision with what the blade cuts through these poses; false: that is nothing, and it is as it was.
bool ResistedBlade::sweep(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report) {
  const topology::RestMap to_rest = state_.to_rest();
  const IncisionBuilder::Mark before = state_.incisions->mark();
  topology::SweepResult swept;
  report.triangles = 0;
  {
    const StageTimer timer(report.seconds.topology);
    for (std::size_t k = 0; k + 1 < poses.size(); ++k)
      state_.incisions->put_off(poses[k]); // a step has many where solves are many
    swept = state_.incisions->move_to(poses.back(), to_rest);
    report.triangles = swept.triangles;
  }
  if (report.triangles == 0) {
    report.reason = swept.refused;
    if (force_.proposed()) // these poses are asked for again, with those after them
      state_.incisions->go_back(before);
    return false;
  }
  require_clear_of_tool(*state_.incisions->incision(), state_.model, state_.scenario.contact.condition);
  state_.check_pieces(sample.time);
  renewed_ = blade_.is_hand_led() ? updater_.lead_zone_by_hand(*state_.incisions->incision()) : "";
  const StageTimer timer(report.seconds.level_sets);
  state_.incisions->update_fields();
  return true;
}

// Proposes the body with the cut that the blade makes through these poses, built and solved; false when it cuts nothing
// or is refused, and then incision and wound are as they were.
bool ResistedBlade::propose(const std::vector<topology::BladePose>& poses, const StepSample& sample,
                            CutReport& report) {
  const IncisionBuilder::Mark before = state_.incisions->mark();
  const BodyUpdate last = report; // by an earlier cut of the same step
  const auto refuse = [&](const char* why) {
    refuse_cut(sample.time, why, report, state_.log);
    report.update = last.update;
    report.update_reason = last.update_reason;
    report.has_grown = last.has_grown;
    report.nodes = last.nodes;
    report.kept_nodes = last.kept_nodes;
    state_.incisions->go_back(before);
    return false;
  };
  try {
    if (!sweep(poses, sample, report))
      return false;
    BodyModel next = updater_.next();
    state_.rebuild = Rebuild::in_step;
    updater_.build_cut(renewed_, next, report);
    const StageTimer timer(report.seconds.solve);
    contact_.solve(sample, next);
    force_.propose(std::move(next), poses.size());
    return true;
  } catch (const InputError& error) {
    return refuse(error.what());
  } catch (const NumericalError& error) {
    return refuse(error.what());
  }
}

// The same, built in the background.
void ResistedBlade::build_in_background(const std::vector<topology::BladePose>& poses, const StepSample& sample,
                                        CutReport& report) {
  try {
    if (!sweep(poses, sample, report))
      return;
    const int triangles = std::exchange(report.triangles, 0);
    background_.propose({poses.size(), sample.time, force_.way().left(force_.edge()), triangles},
                        updater_.following_cut(state_.incisions->incision(), "the blade is resisted", renewed_));
    return;
  } catch (const InputError& error) {
    refuse_cut(sample.time, error.what(), report, state_.log);
  } catch (const NumericalError& error) {
    refuse_cut(sample.time, error.what(), report, state_.log);
  }
  state_.incisions->go_back(*mark_);
}

// It is solved and becomes the blade's; where it could not be made its way is passed without a cut.
void ResistedBlade::take(const StepSample& sample, CutReport& report) {
  state_.rebuild = background_.has_arrived() ? Rebuild::in_background : Rebuild::in_step;
  auto [made, body] = background_.take_proposing();
  try {
    BackgroundBody background = body.get();
    static_cast<BodyUpdate&>(report) = std::move(background.report);
    report.update = SystemUpdate::taken_over;
    report.triangles += made.triangles;
    state_.profile.sprinkle += report.seconds.sprinkling;
    state_.profile.discretise += report.seconds.assembly + report.seconds.visibility;
    state_.profile.condense += report.seconds.solve;
    const StageTimer timer(report.seconds.solve);
    take_over_finite(state_.model, background.model, state_.profile);
    contact_.solve(sample, background.model);
    force_.propose(std::move(background.model), made.poses);
  } catch (const std::runtime_error& error) {
    refuse_cut(made.time, error.what(), report, state_.log);
    state_.incisions->go_back(*mark_);
    forget_mark();
    force_.pass(made.poses, state_.model);
  }
}

} // namespace spherecut::app
