// A blade that the tissue resists (blade_force.hpp): it goes on against the body as it is and cuts as far as its work
// allows.
#include "src/base/stage_timer.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {

void Session::make_blade_force() {
  if (!scenario_.blade || scenario_.toughness == 0)
    return;
  blade_force_ = std::make_unique<BladeForce>(
      scenario_, organ_.domain, zone_.spacing.fine,
      [this](const BodyModel& model) { return [this, &model](const Vector3& x) { return rest_position(x, model); }; },
      toughness_field(scenario_));
  if (blade_force_->finer_than_nodes())
    warn("edge",
         fmt::format("the contact of the blade's edge is narrower than the nodes; it is taken as {:.3g} m wide: "
                     "before it cuts, the blade sinks in less than it would",
                     2 * blade_force_->half_width()));
}

// A blade that cuts nothing, or less than it looks, is told beforehand.
void Session::watch_blade_way() {
  if (!scenario_.blade)
    return;
  const std::string place = fmt::format("{}:{}: ", scenario_.file.string(), scenario_.blade->line);
  const BladeWay way = blade_way(*scenario_.blade, *organ_.domain, zone_.spacing.fine);
  if (way.nearest > 0)
    warn("blade", place + fmt::format("the blade never meets the organ at rest: its edge comes no nearer than {:.3g} "
                                      "mm; blade.path and blade.edge say where it goes",
                                      1e3 * way.nearest));
  const bool in_precut = model_.incision != nullptr && model_.incision->near(way.start_place, zone_.spacing.fine);
  if (way.start_depth > 1e-6 && !in_precut)
    warn("blade",
         place + fmt::format("the blade starts inside the organ, {:.3g} mm deep at [{:.4g}, {:.4g}, {:.4g}] m: "
                             "it cuts what it sweeps from there on, the way in is left uncut; start "
                             "blade.path outside to cut that too",
                             1e3 * way.start_depth, way.start_place.x(), way.start_place.y(), way.start_place.z()));
}

bool Session::blade_enters(const StepSample& sample) const {
  return blade_force_ != nullptr && sample.blade && blade_force_->inside(*sample.blade, model_);
}

// The proposal is not taken any more, and none that is under way.
void Session::drop_blade_proposal() {
  if (proposing_)
    unwanted_ = std::move(proposing_->made);
  proposing_.reset();
  if (mark_)
    incisions_->go_back(*mark_);
  mark_.reset();
  shown_wound_.reset();
}

// What the loads on the body, without the blade, release when the cut grows to `after`: by the intensities at the
// fronts near its new part, J. Two bodies' energies would tell it too, but nodes differ between them.
double Session::drawn_open(const BodyModel& model, const topology::Incision& after) const {
  if (!tears() || model.incision == nullptr)
    return 0;
  const std::optional<std::vector<solvers::FrontState>> states = known_states();
  if (!states || states->empty())
    return 0;
  const double reach = 2 * zone_.spacing.fine;
  double release = 0, weights = 0;
  for (const solvers::FrontState& state : *states)
    if (const auto front = after.front_frame(state.frame.point, reach);
        !front || front->distance > 1e-3 * zone_.spacing.fine) { // it has moved
      release += state.release;
      weights += 1;
    }
  return weights > 0 ? release / weights * std::max(0.0, after.area() - model.incision->area()) : 0;
}

// Where nothing but the blade changes the tissue.
bool Session::proposes_aside() const {
  return following_aside_ && blade_force_ != nullptr && !scenario_.blade->advance && !tears() &&
         !(scenario_.tool && scenario_.tool->grasp);
}

// The energy of the surface that the blade makes on its way to the sample's pose, J.
double Session::press_blade(const StepSample& sample, CutReport& report) {
  const auto to_rest = [this](const Vector3& x) { return rest_position(x, model_); };
  const bool placed = blade_force_->has_place();
  const bool out =
      !blade_force_->inside(*sample.blade, model_); // what it pushes ahead of itself there is cut in the step
  double surface = 0;
  if (placed) {
    const bool leaves = !blade_force_->meets(*sample.blade, model_);
    while (leaves && !passed_.empty() && !blade_force_->meets(passed_.back(), model_))
      passed_.pop_back();
    const bool goes_on = leaves && !passed_.empty(); // before it leaves
    if (goes_on)
      blade_force_->go_to(passed_, model_);
    else
      blade_force_->pass_by(passed_);
    const double far = most_advances * aside_advance * zone_.spacing.fine;
    if (proposing_ && (proposing_->arrived || leaves || out || blade_force_->way_left() - proposing_->way_left > far))
      take_proposal(sample, report);
    const bool lags = proposes_aside() && (blade_force_->proposed() || blade_force_->lags());
    if (goes_on || (leaves && lags)) // what it has come to is cut before
      surface += cut_on(sample, false, report);
  }
  blade_force_->go_to(*sample.blade, model_);
  if (!blade_force_->meets(*sample.blade, model_)) {
    if (const double uncut = blade_force_->passed_uncut(model_); uncut > 0)
      warn("bridge",
           fmt::format("by t = {:g} s the blade has left the organ past up to {:.2g} mm of tissue that it has "
                       "not cut. Nearer than a node spacing ({:.2g} mm) to a surface or a fixed region the "
                       "nodes do not tell what its edge releases: finer ones (nodes.fine_spacing, "
                       "cut.front_spacing) cut farther; what it passes within a step it does not meet: a "
                       "smaller blade.step does",
                       sample.time, 1e3 * uncut, 1e3 * zone_.spacing.fine));
    blade_force_->leave();
    drop_blade_proposal();
    incisions_->place(*sample.blade, to_rest);
    return surface;
  }
  if (!placed)
    incisions_->place(*sample.blade, to_rest);
  return surface + cut_on(sample, proposes_aside() && !out, report);
}

// A cut is built when it comes near, beside the body, and the body becomes it when it is due. Where it is built beside
// the steps the blade waits at the force of steady cutting: what it does is then what it would have done, only later.
// The energy of the surface, J.
double Session::cut_on(const StepSample& sample, bool aside, CutReport& report) {
  const auto to_rest = [this](const Vector3& x) { return rest_position(x, model_); };
  int triangles = report.triangles;
  double surface = 0;
  bool waits = false; // what takes a body over leaves the next one to the next step
  for (;;) {
    waits = waits || proposing_;
    if (const std::vector<topology::BladePose> poses =
            waits ? std::vector<topology::BladePose>{} : blade_force_->wanted(model_);
        !poses.empty()) {
      if (!mark_) {
        mark_ = incisions_->mark();
        shown_wound_ = incisions_->wound();
      }
      if (aside && blade_force_->proposed()) { // a longer cut in its place
        blade_force_->withdraw();
        incisions_->go_back(*mark_);
        continue;
      }
      std::optional<BodyModel> next;
      if (aside)
        begin_proposal(poses, sample, report);
      else
        next = propose_cut(poses, sample, report);
      if (next) {
        triangles += report.triangles;
        const double drawn = drawn_open(model_, *next->incision);
        blade_force_->propose(std::move(*next), poses.size(), drawn);
      } else if (!blade_force_->proposed() && !proposing_) {
        mark_.reset();
        shown_wound_.reset();
        blade_force_->pass(poses.size(), model_);
        continue;
      }
    }
    if ((waits || proposing_) && !blade_force_->proposed()) {
      blade_force_->wait(model_);
      break;
    }
    if (!blade_force_->advance(model_))
      break;
    surface += blade_force_->proposed_surface();
    model_ = blade_force_->take();
    lead_recondensing(sample, to_rest);
    mark_.reset();
    shown_wound_.reset();
    waits = aside;
  }
  report.triangles = triangles;
  return surface;
}

// The incision with what the blade cuts through these poses; false: that is nothing, and it is as it was.
bool Session::sweep_proposal(const std::vector<topology::BladePose>& poses, const StepSample& sample,
                             CutReport& report) {
  const auto to_rest = [this](const Vector3& x) { return rest_position(x, model_); };
  const IncisionBuilder::Mark before = incisions_->mark();
  topology::SweepResult swept;
  report.triangles = 0;
  {
    const StageTimer timer(report.seconds.topology);
    for (std::size_t k = 0; k + 1 < poses.size(); ++k)
      incisions_->put_off(poses[k]); // a step has many where solves are many
    swept = incisions_->move_to(poses.back(), to_rest);
    report.triangles = swept.triangles;
  }
  if (report.triangles == 0) {
    report.reason = swept.refused;
    if (blade_force_->proposed()) // these poses are asked for again, with those after them
      incisions_->go_back(before);
    return false;
  }
  require_clear_of_tool(*incisions_->incision(), model_, scenario_.contact.condition);
  check_pieces(sample.time);
  if (hand_led_)
    zone_.spacing.segments = solvers::front_segments(*incisions_->incision(), zone_.spacing.fine);
  const StageTimer timer(report.seconds.level_sets);
  incisions_->update_fields();
  return true;
}

// The body with the cut that the blade makes through these poses, built and solved; none when it cuts nothing or is
// refused, and then incision and wound are as they were.
std::optional<BodyModel> Session::propose_cut(const std::vector<topology::BladePose>& poses, const StepSample& sample,
                                              CutReport& report) {
  const IncisionBuilder::Mark before = incisions_->mark();
  const BodyUpdate last = report; // by an earlier cut of the same step
  const auto refuse = [&](const char* why) {
    refuse_cut(sample.time, why, report);
    report.update = last.update;
    report.update_reason = last.update_reason;
    report.nodes = last.nodes;
    report.kept_nodes = last.kept_nodes;
    incisions_->go_back(before);
    return std::nullopt;
  };
  try {
    if (!sweep_proposal(poses, sample, report))
      return std::nullopt;
    BodyModel next;
    next.touched_from = facing();
    next.incision = incisions_->incision();
    rebuild_ = Rebuild::in_step;
    const auto to_rest = [this](const Vector3& x) { return rest_position(x, model_); };
    build_cut({.way_ahead = [&] { return way_of_blade(sample, to_rest); }, .beside = true}, next, report);
    const StageTimer timer(report.seconds.solve);
    solve(sample, next);
    return next;
  } catch (const InputError& error) {
    return refuse(error.what());
  } catch (const NumericalError& error) {
    return refuse(error.what());
  }
}

// The same, built beside the steps; false where it is not.
bool Session::begin_proposal(const std::vector<topology::BladePose>& poses, const StepSample& sample,
                             CutReport& report) {
  try {
    if (!sweep_proposal(poses, sample, report))
      return false;
    proposing_ = Proposing{poses.size(),
                           sample.time,
                           blade_force_->way_left(),
                           std::exchange(report.triangles, 0),
                           false,
                           make_beside(incisions_->incision(), "the blade is resisted")};
    return true;
  } catch (const InputError& error) {
    refuse_cut(sample.time, error.what(), report);
  } catch (const NumericalError& error) {
    refuse_cut(sample.time, error.what(), report);
  }
  incisions_->go_back(*mark_);
  return false;
}

// It is solved and becomes the blade's; where it could not be made its way is passed without a cut.
void Session::take_proposal(const StepSample& sample, CutReport& report) {
  Proposing made = std::move(*proposing_);
  proposing_.reset();
  rebuild_ = made.arrived ? Rebuild::aside : Rebuild::in_step;
  try {
    MadeAside aside = made.made.get();
    static_cast<BodyUpdate&>(report) = std::move(aside.report);
    report.update = SystemUpdate::taken_over;
    report.triangles += made.triangles;
    profile_.sprinkle += report.seconds.sprinkling;
    profile_.discretise += report.seconds.assembly + report.seconds.visibility;
    profile_.condense += report.seconds.solve;
    const StageTimer timer(report.seconds.solve);
    solve(sample, aside.model);
    blade_force_->propose(std::move(aside.model), made.poses);
  } catch (const std::runtime_error& error) {
    refuse_cut(made.time, error.what(), report);
    incisions_->go_back(*mark_);
    mark_.reset();
    shown_wound_.reset();
    blade_force_->pass(made.poses, model_);
  }
}

} // namespace spherecut::app
