#include "src/session/blade_cutting.hpp"

#include "src/base/stage_timer.hpp"
#include "src/tissue/cut_checks.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {

BladeCutting::BladeCutting(SessionState& state, BladeTrack& blade, ContactSolver& contact, const Grasping& grasping,
                           BackgroundBodies& background, BodyUpdater& updater)
    : state_(state), blade_(blade), contact_(contact), grasping_(grasping), background_(background), updater_(updater) {
}

bool BladeCutting::ends(const StepSample& sample) const {
  return !state_.options.going_on && sample.time == state_.steps.back().time;
}

bool BladeCutting::makes_in_background(const StepSample& sample) const {
  return cut_policy(state_.scenario, state_.options) == CutPolicy::in_background && state_.model.solved() &&
         !ends(sample);
}

double BladeCutting::advance() const {
  return blade_advance(state_.scenario, state_.options) * state_.zone.fine();
}

bool BladeCutting::move(const StepSample& sample, CutReport& report) {
  bool solved = false;
  const auto wait = [&] {
    if (!background_.follows_cut())
      return;
    wait_for(sample, report);
    solved = true;
  };
  const auto make_cut = [&](const StepSample& at, bool places) {
    wait();
    blade_.body_follows();
    CutReport made;
    const bool is_solved = cut(at, places, made);
    solved = is_solved || (solved && !made.refused);
    report.add(made);
  };
  if (!sample.blade || blade_.is_lifted()) {
    if (background_.follows_cut() && !sample.blade && !ends(sample)) // nothing needs the blade until its body is there
      return false;
    wait();
    if (blade_.put_off() > 0) { // a lifted blade is placed anew in the step after this one
      StepSample left = sample;
      left.blade = blade_.take_last();
      make_cut(left, false);
      return solved;
    }
    if (!sample.blade)
      return solved;
  }
  if (is_put_off(sample))
    return solved;
  make_cut(sample, blade_.is_lifted());
  return solved;
}

// Whether the body need not follow yet; the motion is then kept for later.
bool BladeCutting::is_put_off(const StepSample& sample) {
  if (!blade_.last() || blade_.is_lifted())
    return false;
  for (const topology::BladePose& pose : blade_.passed())
    state_.incisions->put_off(pose);
  if (ends(sample))
    return false;
  const bool is_in_background = cut_policy(state_.scenario, state_.options) == CutPolicy::in_background;
  const bool leaves_off = is_in_background && blade_.rests() && blade_.put_off() > 0;
  if (is_in_background && !leaves_off && !blade_.moved_at(sample.time)) // it is where it was
    return true;
  if (advance() <= 0)
    return false;
  blade_.put_off(blade_.way_to(*sample.blade));
  const bool is_outside = state_.incisions->is_outside(*sample.blade, state_.to_rest_if_moved());
  const bool waits = background_.follows_cut() ? is_outside || blade_.put_off() < most_advances * advance()
                                               : !is_outside && !leaves_off && blade_.put_off() < advance();
  if (waits)
    state_.incisions->put_off(*sample.blade);
  return waits;
}

// Moves the blade, or only places it; true when that cut something and the body with the new cut is built and solved.
bool BladeCutting::cut(const StepSample& sample, bool places, CutReport& report) {
  const topology::RestMap to_rest = state_.to_rest_if_moved();
  topology::SweepResult swept;
  std::optional<topology::Wound> wound_before;
  if (places)
    blade_.put_down();
  {
    const StageTimer timer(report.seconds.topology);
    try {
      if (places)
        state_.incisions->place(*sample.blade, to_rest);
      else
        swept =
            state_.incisions->move_to(*sample.blade, to_rest, makes_in_background(sample) ? &wound_before : nullptr);
    } catch (const InputError& error) {
      refuse_cut(sample.time, error.what(), report, state_.log);
    } catch (const NumericalError& error) {
      refuse_cut(sample.time, error.what(), report, state_.log);
    }
  }
  report.triangles = swept.triangles;
  if (swept.triangles == 0) {
    if (!report.refused)
      report.reason = swept.refused;
    return false;
  }
  try {
    return build(sample, std::move(wound_before), report);
  } catch (const InputError& error) {
    refuse_cut(sample.time, error.what(), report, state_.log);
  } catch (const NumericalError& error) {
    refuse_cut(sample.time, error.what(), report, state_.log);
  }
  state_.incisions->take_back();
  return false;
}

// The body with what has been cut, in the step or in the background. True: it is there and solved.
bool BladeCutting::build(const StepSample& sample, std::optional<topology::Wound> wound_before, CutReport& report) {
  BodyModel next = updater_.next();
  if (!grasping_.holds()) // a grasper remembers what it holds
    require_clear_of_tool(*next.incision, state_.model, state_.scenario.contact.condition);
  state_.check_pieces(sample.time);
  const std::string renewed = blade_.is_hand_led() ? updater_.lead_zone_by_hand(*next.incision) : "";
  {
    const StageTimer timer(report.seconds.level_sets);
    state_.incisions->update_fields();
  }
  const bool in_background = makes_in_background(sample);
  if (in_background) {
    const int triangles = std::exchange(report.triangles, 0);
    background_.follow({std::nullopt, sample.time, triangles},
                       updater_.following_cut(next.incision, "the cut was put off", renewed));
    state_.shown_wound = std::move(wound_before);
  } else {
    state_.rebuild = Rebuild::in_step;
    updater_.build_cut(renewed, next, report);
    const StageTimer timer(report.seconds.solve);
    contact_.solve(sample, next);
  }
  state_.profile.topology += report.seconds.topology;
  state_.profile.level_sets += report.seconds.level_sets;
  if (in_background)
    return false;
  state_.model = std::move(next);
  return true;
}

bool BladeCutting::take() {
  auto [following, body] = background_.take_following();
  state_.shown_wound.reset();
  CutReport& report = taken_.emplace();
  try {
    BackgroundBody made = body.get();
    static_cast<BodyUpdate&>(report) = std::move(made.report);
    report.update = SystemUpdate::taken_over;
    report.triangles = following.triangles;
    state_.rebuild =
        blade_.put_off() < advance() * most_advances / 3 ? Rebuild::in_background_early : Rebuild::in_background;
    state_.profile.sprinkle += report.seconds.sprinkling;
    state_.profile.discretise += report.seconds.assembly + report.seconds.visibility;
    state_.profile.condense += report.seconds.solve;
    take_over_finite(state_.model, made.model, state_.profile);
    contact_.keep_grip();
    state_.model = std::move(made.model);
  } catch (const std::runtime_error& error) {
    state_.incisions->take_back();
    refuse_cut(following.time, error.what(), report, state_.log);
  }
  return !report.refused;
}

// The body has to be at its cut before the step goes on.
void BladeCutting::wait_for(const StepSample& sample, CutReport& report) {
  take();
  state_.rebuild = Rebuild::in_step;
  contact_.go_on_with_kept_grip();
  contact_.solve(sample, state_.model);
  report.add(*take_report());
}

void watch_blade_way(const Scenario& scenario, const topology::Domain& domain, const topology::Incision* incision,
                     double fine, SessionLog& log) {
  if (!scenario.blade)
    return;
  const std::string place = fmt::format("{}:{}: ", scenario.file.string(), scenario.blade->line);
  const BladeWay way = blade_way(*scenario.blade, domain, fine);
  if (way.nearest > 0)
    log.warn("blade",
             place + fmt::format("the blade never meets the organ at rest: its edge comes no nearer than {:.3g} "
                                 "mm; blade.path and blade.edge say where it goes",
                                 1e3 * way.nearest));
  const bool in_precut = incision != nullptr && incision->near(way.start_place, fine);
  if (way.start_depth > 1e-6 && !in_precut)
    log.warn("blade",
             place + fmt::format("the blade starts inside the organ, {:.3g} mm deep at [{:.4g}, {:.4g}, {:.4g}] m: "
                                 "it cuts what it sweeps from there on, the way in is left uncut; start "
                                 "blade.path outside to cut that too",
                                 1e3 * way.start_depth, way.start_place.x(), way.start_place.y(), way.start_place.z()));
}

} // namespace spherecut::app
