#include "src/tissue/body_updater.hpp"

#include "solvers/nodes/sheets.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/dropped_nodes.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {
namespace {

constexpr const char* spacing_changed = "the spacing has changed";

} // namespace

BodyUpdater::BodyUpdater(SessionState& state, ContactSolver& contact, const Grasping& grasping,
                         BackgroundBodies& background)
    : state_(state), scenario_(state.scenario), organ_(state.organ), model_(state.model), contact_(contact),
      grasping_(grasping), background_(background) {}

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
  assemble(model);
  contact_.condense(near, model);
}

void BodyUpdater::assemble(BodyModel& model) {
  const StageTimer timer(state_.profile.discretise);
  background_.drop_following();
  app::assemble(scenario_, organ_.domain, model);
  const solvers::SprinkleReport& report = model.sprinkling.report;
  state_.log.say(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed",
                             model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes, report.lip_nodes,
                             held_nodes(model.body->problem().prescribed)));
}

// Nodes are fine about a front that tears, as far as its intensities ask for it. Where they stay as the cut appends,
// the front's way ahead is in the fine zone too, so that the zone lasts; elsewhere the zone goes along at every
// increment.
std::string BodyUpdater::lead_zone(const topology::Incision& incision) {
  if (incision.front().empty())
    return "no front is left";
  const bool appends = cut_appends(scenario_);
  if (appends && is_nonlinear(scenario_.law))
    return state_.zone.lead_ahead(incision);
  std::string hindrance = state_.hindrance();
  if (appends && hindrance.empty())
    return state_.zone.lead_ahead(incision);
  state_.zone.follow_fronts_and_way(incision);
  return hindrance.empty() ? "nodes go along with the front" : hindrance;
}

// A body that appends keeps its nodes until the front leaves those that are fine; beside any other cut they are
// exchanged at every increment.
std::string BodyUpdater::lead_zone_by_hand(const topology::Incision& incision) {
  if (cut_appends(scenario_) && !is_nonlinear(scenario_.law))
    return state_.zone.lead_by_hand(incision, model_.sprinkling.nodes);
  state_.zone.follow_fronts(incision);
  return "";
}

void BodyUpdater::build_cut(const std::string& renewed, BodyModel& next, BodyUpdate& report) {
  if (is_nonlinear(scenario_.law)) {
    build_finite_cut(next, report);
    return;
  }
  const std::string unfollowed = state_.hindrance();
  std::optional<solvers::SprinkleIncrement> exchanged;
  report.update = SystemUpdate::rebuilt;
  report.has_grown = false;
  report.update_reason = !unfollowed.empty() ? unfollowed : !spacing_stays() ? spacing_changed : renewed;
  if (report.update_reason.empty()) {
    const StageTimer timer(report.seconds.sprinkling);
    const StageTimer sprinkle_timer(state_.profile.sprinkle);
    try {
      exchanged = exchange_nodes(*organ_.domain, sprinkle_options(next), model_, next.sprinkling);
      next.coarseness = state_.zone.coarseness();
    } catch (const NumericalError& error) {
      report.update_reason = error.what();
    }
  }
  next.uncut = model_.uncut;
  std::vector<int> near;
  const auto make = [&] {
    near = contact_.candidates_in_reach(next);
    const StageTimer timer(report.seconds.assembly);
    if (exchanged && state_.options.updating) {
      const StageTimer growth_timer(state_.profile.discretise);
      report.update_reason = model_.body == nullptr
                                 ? "the first cut"
                                 : follow_cut(scenario_, organ_.domain, *exchanged, body_to_grow(model_), next);
      report.has_grown = next.body != nullptr;
      if (report.has_grown)
        report.update = SystemUpdate::updated;
    }
    if (next.body == nullptr)
      assemble(next);
  };
  const double seen = solvers::sight_seconds();
  if (exchanged) {
    try {
      make();
    } catch (const std::runtime_error& error) { // no sound support, or no node left where the body is held: with all
      report.update_reason = error.what();      // nodes made anew there may be
      exchanged.reset();
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
    app::assemble(scenario, domain, model);
    app::condense(without_dropped(near, scenario, *model.body), model);
    find_lips(model);
    return made;
  };
}

BackgroundBodies::Make BodyUpdater::following_cut(const std::shared_ptr<const topology::Incision>& incision,
                                                  const char* reason, const std::string& by_zone) const {
  const std::string hindrance = is_nonlinear(scenario_.law) ? not_linear : state_.hindrance(),
                    renewed = !hindrance.empty() ? hindrance
                              : spacing_stays()  ? by_zone
                                                 : spacing_changed;
  const FineZoneTracker& zone = state_.zone;
  return [&scenario = scenario_, domain = organ_.domain, how = zone.sprinkle_options(incision, grasping_.kept_nodes()),
          incision_before = model_.incision, sprinkling = model_.sprinkling, lineage = model_.lineage, renewed, reason,
          uncut = model_.uncut,
          growing = std::make_shared<std::unique_ptr<solvers::Discretisation>>(
              renewed.empty() && state_.options.updating ? body_to_grow(model_) : nullptr),
          coarseness = zone.coarseness(), centre = contact_.is_in_reach() ? zone.centre() : std::nullopt,
          reach = zone.zone().candidate_radius, facing = zone.facing()] {
    BackgroundBody made;
    BodyModel& model = made.model;
    BodyUpdate& update = made.report;
    model.incision = how.incision;
    model.coarseness = coarseness;
    model.touched_from = facing;
    model.lineage = lineage;
    model.uncut = uncut;
    BodyModel before;
    before.incision = incision_before;
    before.sprinkling = sprinkling;
    double sight = 0, condensing = 0; // s, of the attempt that goes
    solvers::SprinkleIncrement exchanged;
    const auto follow_or_assemble = [&] {
      update.has_grown = *growing != nullptr;
      if (update.has_grown)
        update.has_grown = follow_cut(scenario, domain, exchanged, std::move(*growing), model).empty();
      if (!update.has_grown)
        app::assemble(scenario, domain, model);
    };
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
          follow_or_assemble();
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
        build([&] { exchanged = exchange_nodes(*domain, how, before, model.sprinkling); });
        update.update_reason = reason;
      } catch (const std::runtime_error& error) { // with all nodes made anew it may go
        update.update_reason = error.what();
        model.body.reset();
        growing->reset();
      }
    if (model.body == nullptr)
      build([&] { model.sprinkling = resprinkle_held(scenario, *domain, how, before.sprinkling.nodes); });
    report_body(model, sight, update);
    update.seconds.solve += condensing;
    return made;
  };
}

} // namespace spherecut::app
