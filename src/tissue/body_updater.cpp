#include "src/tissue/body_updater.hpp"

#include "solvers/nodes/sheets.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/dropped_nodes.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {
namespace {

// Of the nodes in a window that follows a tear. Processor time of an increment, updated against rebuilt, and what
// making the window takes in place of the latter: 0.46, 0.95 and 1.7 s where it holds a quarter (1600 nodes), 0.35,
// 0.34 and 0.55 s at 0.54 (590 nodes), 1.25, 1.4 and 2.9 s at two thirds (1380 nodes). A window serves
// as many updates as fit into its zone: one of a spacing, three of a half, six of a quarter.
constexpr double largest_share = 0.5;
constexpr const char* spacing_changed = "the spacing has changed";

} // namespace

BodyUpdater::BodyUpdater(SessionState& state, ContactSolver& contact, const Grasping& grasping,
                         BackgroundBodies& background, WindowRenewal& renewal)
    : state_(state), scenario_(state.scenario), organ_(state.organ), model_(state.model), contact_(contact),
      grasping_(grasping), background_(background), renewal_(renewal) {}

BodyModel BodyUpdater::next() const {
  BodyModel next;
  next.touched_from = state_.zone.facing();
  next.incision = state_.incisions != nullptr ? state_.incisions->incision() : nullptr;
  return next;
}

solvers::SprinkleOptions BodyUpdater::sprinkle_options(const BodyModel& model) const {
  return state_.zone.sprinkle_options(model.incision, grasping_.kept_nodes());
}

bool BodyUpdater::spacing_stays() const {
  return model_.coarseness == state_.zone.coarseness();
}

void BodyUpdater::sprinkle(const solvers::NodeCloud* previous, BodyModel& model) const {
  const StageTimer timer(state_.profile.sprinkle);
  const solvers::SprinkleOptions options = sprinkle_options(model);
  model.sprinkling = previous == nullptr ? solvers::sprinkle(*organ_.domain, options)
                                         : resprinkle_held(scenario_, *organ_.domain, options, *previous);
  model.coarseness = state_.zone.coarseness();
}

void BodyUpdater::build(BodyModel& model) {
  if (is_nonlinear(scenario_.law)) {
    background_.drop_following();
    make_finite(state_, model, &model_);
    return;
  }
  const std::vector<int> near = contact_.candidates_in_reach(model);
  assemble(model, {}, near);
  contact_.condense(near, model);
}

void BodyUpdater::assemble(BodyModel& model, const topology::SurfaceMesh& way_ahead, const std::vector<int>& near) {
  const StageTimer timer(state_.profile.discretise);
  renewal_.drop();
  background_.drop_following();
  app::assemble(scenario_, organ_.domain, model, way_ahead, near);
  const solvers::SprinkleReport& report = model.sprinkling.report;
  state_.log.say(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed",
                             model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes, report.lip_nodes,
                             held_nodes(model.body->problem().prescribed)));
}

// Nodes are fine about a front that tears, as far as its intensities ask for it. Where updates pay, its way ahead is in
// the fine zone too; elsewhere the zone goes along at every increment.
void BodyUpdater::lead_zone(const topology::Incision& incision, CutGrowth& growth) {
  if (incision.front().empty()) {
    growth.renewed = "no front is left";
    return;
  }
  const auto why_not = [&, way = growth.way_ahead()]() -> std::string {
    if (is_nonlinear(scenario_.law) && cut_appends(scenario_))
      return "";
    if (std::string hindrance = state_.hindrance(); !hindrance.empty())
      return hindrance;
    if (cut_appends(scenario_))
      return "";
    if (way.triangles.empty())
      return "no front that has moved goes on";
    if (solvers::window_share(model_.body->problem(), scenario_.method, way) > largest_share)
      return too_much_of_body;
    return can_follow(scenario_, model_, way) ? "" : "too many nodes for a window by this method";
  };
  if (growth.renewed = why_not(); !growth.renewed.empty()) {
    growth.window_pays = false;
    state_.zone.follow_fronts_and_way(incision);
    return;
  }
  growth.renewed = state_.zone.lead_ahead(incision);
}

void BodyUpdater::build_cut(const CutGrowth& growth, BodyModel& next, BodyUpdate& report) {
  if (is_nonlinear(scenario_.law)) {
    build_finite_cut(next, report);
    return;
  }
  const std::string unfollowed = growth.beside ? "the blade is resisted" : state_.hindrance();
  const bool follows = state_.options.updating && unfollowed.empty() && growth.window_pays;
  followed_.reset();
  report.update = SystemUpdate::rebuilt;
  report.update_reason = !unfollowed.empty() ? unfollowed : !spacing_stays() ? spacing_changed : growth.renewed;
  if (report.update_reason.empty()) {
    const StageTimer timer(report.seconds.sprinkling);
    const StageTimer sprinkle_timer(state_.profile.sprinkle);
    try {
      followed_ = exchange_nodes(*organ_.domain, sprinkle_options(next), model_, next.sprinkling);
      next.coarseness = state_.zone.coarseness();
    } catch (const NumericalError& error) {
      report.update_reason = error.what();
    }
  }
  std::vector<int> near;
  const auto make = [&] {
    near = contact_.candidates_in_reach(next);
    const StageTimer timer(report.seconds.assembly);
    if (followed_ && follows) {
      const StageTimer growth_timer(state_.profile.discretise);
      const solvers::BodyGrowth grown = follow_cut(growth.way_ahead, next, report);
      report.update_reason = next.body == nullptr ? grown.uncovered : grown.update.reason;
    }
    if (next.body == nullptr) {
      next.uncut = model_.uncut;
      assemble(next, follows ? growth.way_ahead() : topology::SurfaceMesh{}, near);
    }
  };
  const double seen = solvers::sight_seconds();
  if (followed_) {
    try {
      make();
    } catch (const std::runtime_error& error) { // no sound support, or no node left where the body is held: with all
      report.update_reason = error.what();      // nodes made anew there may be
      followed_.reset();
    }
  }
  if (next.body == nullptr) {
    {
      const StageTimer timer(report.seconds.sprinkling);
      sprinkle(&model_.sprinkling.nodes, next);
    }
    make();
  }
  report_body(next, solvers::sight_seconds() - seen, report);
  const StageTimer timer(report.seconds.solve);
  contact_.condense(near, next, true);
}

// A body on the nodes of the new cut, which goes on from where the one before has come to.
void BodyUpdater::build_finite_cut(BodyModel& next, BodyUpdate& report) const {
  report.update = SystemUpdate::rebuilt;
  report.update_reason = not_linear;
  {
    const StageTimer timer(report.seconds.sprinkling);
    sprinkle(&model_.sprinkling.nodes, next);
  }
  {
    const StageTimer timer(report.seconds.assembly);
    make_finite(state_, next, &model_);
    if (grasping_.holds())
      next.finite->hold_on(grasping_.nodes(next, state_.zone.fine()), *model_.finite);
  }
  report_body(next, 0, report);
}

// By an update alone where a replacement is on its way; where that cannot be, the replacement takes over and follows.
solvers::BodyGrowth BodyUpdater::follow_cut(const std::function<topology::SurfaceMesh()>& way_ahead, BodyModel& next,
                                            BodyUpdate& report) {
  const bool follows = dynamic_cast<const solvers::Growable*>(model_.body.get()) != nullptr;
  const auto grow = [&](bool only_update) {
    return app::follow_cut(scenario_, organ_.domain, *followed_, way_ahead, model_, next, only_update);
  };
  // Where motion is put off a body that leaves its window is only given another one if that pays.
  const auto pays = [&](const topology::SurfaceMesh& way) {
    return way.triangles.empty() || can_follow(scenario_, model_, way);
  };
  const bool renews =
      !follows || !scenario_.blade || blade_advance(scenario_, state_.options) == 0 || pays(way_ahead());
  solvers::BodyGrowth growth = grow(renewal_.is_under_way() || !renews);
  bool taken = false;
  if (next.body == nullptr && renewal_.is_under_way() && (growth.update.declined || !follows)) {
    solvers::ContactPatch unused;
    taken = renewal_.take(unused);
    if (taken || follows)
      growth = grow(false);
  }
  if (next.body != nullptr)
    report.update = growth.update.condensed_anew ? SystemUpdate::condensed_anew
                    : taken                      ? SystemUpdate::taken_over
                                                 : SystemUpdate::updated;
  return growth;
}

bool BodyUpdater::take_back_cut(const solvers::Discretisation* body) {
  state_.incisions->take_back();
  if (model_.body.get() == body)
    return false;
  try {
    if (model_.body == nullptr) { // it had followed the cut before that was refused; else another had taken over
      renewal_.drop();
      app::assemble(scenario_, organ_.domain, model_);
    }
    condense_again();
  } catch (const std::runtime_error& error) {
    model_.body.reset(); // the next step builds it
    model_.state.reset();
    throw NumericalError(
        fmt::format("the body cannot be had again as it was before a cut that was refused: {}", error.what()));
  }
  return true;
}

// Another body has taken over on the same nodes: contact goes on from where it is.
void BodyUpdater::condense_again() {
  std::optional<solvers::CutContactState> state = std::move(model_.state);
  contact_.condense(std::vector<int>(model_.patch.nodes), model_, true);
  model_.state = std::move(state);
  model_.front_rules = {};
}

// It takes over together with what it was condensed onto, where that is what the tool may touch now.
bool BodyUpdater::take_renewed() {
  solvers::ContactPatch patch;
  if (!renewal_.take(patch))
    return false;
  model_.lips.reset();
  if (patch.nodes != model_.patch.nodes) {
    condense_again();
    return true;
  }
  model_.base = patch.base;
  patch.lifts = std::move(model_.patch.lifts);
  model_.patch = std::move(patch);
  return true;
}

BackgroundBodies::Make BodyUpdater::following_tool(const topology::SurfaceContact& centre) const {
  FineZoneTracker there = state_.zone;
  there.move_to(centre);
  return [&scenario = scenario_, domain = organ_.domain,
          how = there.sprinkle_options(model_.incision, grasping_.kept_nodes()), previous = model_.sprinkling.nodes,
          lineage = model_.lineage, coarseness = state_.zone.coarseness(), centre,
          reach = state_.zone.zone().candidate_radius] {
    BackgroundBody made;
    BodyModel& model = made.model;
    model.incision = how.incision;
    model.sprinkling = resprinkle_held(scenario, *domain, how, previous);
    model.coarseness = coarseness;
    model.touched_from = centre.normal;
    model.lineage = lineage;
    const std::vector<int> near = touchable_nodes(scenario, *domain, model.sprinkling.nodes, centre, reach);
    if (is_nonlinear(scenario.law)) {
      make_finite_apart(scenario, domain, near, model);
      return made;
    }
    app::assemble(scenario, domain, model, {}, near);
    app::condense(without_dropped(near, scenario, *model.body), model);
    find_lips(model);
    return made;
  };
}

// Rebuilt: no window pays that serves one increment.
BackgroundBodies::Make BodyUpdater::following_cut(const std::shared_ptr<const topology::Incision>& incision,
                                                  const char* reason) const {
  const std::string renewed = is_nonlinear(scenario_.law) ? not_linear
                              : spacing_stays()           ? state_.hindrance()
                                                          : spacing_changed;
  const FineZoneTracker& zone = state_.zone;
  return [&scenario = scenario_, domain = organ_.domain, how = zone.sprinkle_options(incision, grasping_.kept_nodes()),
          incision_before = model_.incision, sprinkling = model_.sprinkling, lineage = model_.lineage, renewed, reason,
          coarseness = zone.coarseness(), centre = contact_.is_in_reach() ? zone.centre() : std::nullopt,
          reach = zone.zone().candidate_radius, facing = zone.facing()] {
    BackgroundBody made;
    BodyModel& model = made.model;
    BodyUpdate& update = made.report;
    model.incision = how.incision;
    model.coarseness = coarseness;
    model.touched_from = facing;
    model.lineage = lineage;
    BodyModel before;
    before.incision = incision_before;
    before.sprinkling = sprinkling;
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
        if (is_nonlinear(scenario.law))
          make_finite_apart(scenario, domain, near, model);
        else
          app::assemble(scenario, domain, model, {}, near);
        sight = solvers::sight_seconds() - seen;
      }
      if (model.finite != nullptr)
        return;
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
}

} // namespace spherecut::app
