#include "src/session/setting_out.hpp"

#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/session/blade_cutting.hpp"
#include "src/session/finite_stepper.hpp"
#include "src/session/foresight.hpp"
#include "src/tissue/cut_checks.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/way_out.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double stiffest_galerkin = 0.49; // Poisson's ratio

// With the place in the file where the motion begins.
std::vector<ToolSample> tool_motion_of(const Scenario& scenario, const topology::ContactQuery& query,
                                       const BoundingBox& bounds) {
  try {
    return tool_motion(*scenario.tool, query, bounds);
  } catch (const InputError& error) {
    const auto* approach = std::get_if<Approach>(&scenario.tool->motion);
    const int line =
        approach != nullptr ? approach->line : std::get<std::vector<PathPoint>>(scenario.tool->motion).front().line;
    throw InputError(fmt::format("{}:{}: {}", scenario.file.string(), line, error.what()));
  }
}

// Where the tool meets the organ. A device may do so anywhere: it is expected where the path comes nearest.
std::optional<FirstTouch> find_touch(const SessionState& state, const std::vector<ToolSample>& motion, Leader leader) {
  if (state.scenario.tool->grasp)
    return find_grasp(state.scenario, *state.organ.domain, motion, leader == Leader::path);
  const std::optional<FirstTouch> touch = first_touch(*state.scenario.tool, motion, state.query);
  return touch || leader == Leader::path ? touch : nearest_approach(*state.scenario.tool, motion, state.query);
}

// An approach that ends beyond the other side of the organ: there is nothing there that the tool would press on.
void watch_depth(SessionState& state) {
  constexpr double grazing = 0.5; // cosine of the angle between way and surface normal: below it a touch is no press
  const auto* approach = std::get_if<Approach>(&state.scenario.tool->motion);
  if (approach == nullptr || !state.touch || -approach->direction.dot(state.touch->contact.normal) < grazing)
    return;
  const Vector3& at = state.touch->contact.point;
  if (const double thickness = topology::way_out(*state.organ.domain, at, approach->direction, 2 * approach->depth);
      approach->depth >= thickness)
    state.log.warn("depth", fmt::format("tool.approach.depth = {:g} m, but at [{:.4g}, {:.4g}, {:.4g}] m the organ at "
                                        "rest is {:.3g} m thick along the tool's way: the tool goes through it, and "
                                        "the run ends there",
                                        approach->depth, at.x(), at.y(), at.z(), thickness));
}

} // namespace

void set_out(SessionState& state, Leader leader) {
  std::vector<ToolSample> motion;
  if (state.scenario.tool) {
    motion = tool_motion_of(state.scenario, state.query, state.organ.domain->bounds());
    state.touch = find_touch(state, motion, leader);
  }
  state.steps = schedule(state.scenario, motion, state.zone.spacing().fine, sheet_edge(state.zone.zone()),
                         topology::SweepOptions{}.most_triangles);
  if (state.scenario.method.method == solvers::Method::published)
    state.log.warn("published", "the published scheme does not converge and its force is not one in newtons: see docs");
  if (state.scenario.method.method == solvers::Method::galerkin && !is_nonlinear(state.scenario.law) &&
      state.scenario.material.poisson_ratio > stiffest_galerkin)
    state.log.warn("locking",
                   fmt::format("method galerkin has no pressure of its own: at poisson_ratio = {:g}, above {:g}, it is "
                               "too stiff, by some percent at usual spacings; collocation is not",
                               state.scenario.material.poisson_ratio, stiffest_galerkin));
  if (state.scenario.tool && !state.touch)
    state.log.warn("touch", "the tool never touches the organ on its way");
  if (state.scenario.tool)
    watch_depth(state);
  if (has_cuts(state.scenario)) {
    const StageTimer timer(state.profile.topology);
    state.incisions =
        std::make_unique<IncisionBuilder>(state.scenario, state.organ.domain, sheet_edge(state.zone.zone()));
    state.model.incision = state.incisions->incision();
    for (const std::string& remark : state.incisions->remarks())
      state.log.warn(remark, remark);
    state.incisions->update_fields();
  }
  watch_blade_way(state.scenario, *state.organ.domain, state.model.incision.get(), state.zone.fine(), state.log);
}

void lay_first_nodes(SessionState& state, const BodyUpdater& updater) {
  if (state.touch)
    state.zone.begin_at(state.zone.centre_of(state.touch->contact, state.touch->pose));
  state.model.touched_from = state.zone.facing();
  if (state.zone.find_gaps() && cut_appends(state.scenario)) {
    const bool is_wanted = std::exchange(state.scenario.cut.sight, solvers::SightRule::enriched).has_value();
    if (is_wanted)
      state.log.warn("gaps", "cut.sight = \"appended\" takes spheres that see through the narrow gaps of this organ: "
                             "\"enriched\" is used");
  }
  std::vector<Vector3> places;
  if (state.zone.centre())
    places = is_nonlinear(state.scenario.law) && state.leader == Leader::path
                 ? places_of_contact(state)
                 : std::vector<Vector3>{state.zone.centre()->point};
  state.zone.lay_out(std::move(places), state.model.incision,
                     state.scenario.precuts.empty() ? nullptr : &state.incisions->wound());
  if (!state.scenario.precuts.empty())
    try {
      require_pieces(state.incisions->wound(), state.zone.spacing());
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}:{}: {}", state.scenario.file.string(), state.scenario.precuts.front().line, error.what()));
    }
  try {
    state.zone.judge_walls(state.log);
    if (const std::optional<std::string> front = coarse_front(state.scenario, *state.organ.domain, state.zone.zone()))
      state.log.warn("front", *front);
    if (!state.scenario.precuts.empty())
      for (const std::string& pair : close_precuts(state.scenario, *state.incisions->incision(), state.zone.zone()))
        state.log.warn(pair, pair);
    updater.sprinkle(nullptr, state.model);
  } catch (const InputError& error) { // what was odd about the organ may be why
    std::string all =
        fmt::format("{}: [nodes] fine_spacing and coarse_spacing: {}", state.scenario.file.string(), error.what());
    for (const std::string& remark : state.organ.remarks)
      all += "\n" + remark;
    throw InputError(all);
  }
  require_first_steps(state);
  if (has_cuts(state.scenario)) // regions that hold nothing have been told by now: no piece is severed by that
    check_held(state.scenario, state.incisions->wound(), state.steps.front().time, state.log);
}

bool approach_hanging(SessionState& state, BodyUpdater& updater) {
  const bool is_loaded = state.scenario.gravity || !state.scenario.pretension.isZero() ||
                         std::any_of(state.scenario.precuts.begin(), state.scenario.precuts.end(),
                                     [](const PrecutSettings& precut) { return precut.pressure != 0; });
  if (!is_loaded || !can_run(state.scenario) || !state.touch ||
      !std::holds_alternative<Approach>(state.scenario.tool->motion))
    return false;
  if (is_nonlinear(state.scenario.law)) {
    make_finite(state, state.model);
    try {
      solve_finite(state.steps.front().time, std::nullopt, state.model, state.profile);
    } catch (const NumericalError& error) {
      throw NumericalError(without_equilibrium(state, state.steps.front().time, false, error));
    }
  } else {
    updater.assemble(state.model);
    app::condense({}, state.model);
    solve_contact(nullptr, nullptr, state.scenario, state.model);
  }
  topology::SurfaceMesh hanging = state.organ.domain->surface();
  for (Vector3& x : hanging.vertices)
    x += state.model.at(x).displacement;
  state.model.state.reset();
  std::vector<ToolSample> motion;
  try {
    motion = tool_motion_of(state.scenario, topology::ContactQuery(hanging), topology::bounds(hanging));
  } catch (const InputError& error) {
    throw InputError(fmt::format("{} (of the organ as its loads have moved it before the tool comes)", error.what()));
  }
  const Vector3 sag = motion.back().pose.point - state.steps.back().tool->point;
  state.steps = schedule(state.scenario, motion, state.zone.spacing().fine, sheet_edge(state.zone.zone()),
                         topology::SweepOptions{}.most_triangles);
  state.log.say(fmt::format("the loads move the tool's first touch by {:.3g} mm", 1e3 * sag.norm()));
  return true;
}

} // namespace spherecut::app
