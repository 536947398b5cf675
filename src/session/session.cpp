#include "src/session/session.hpp"

#include "solvers/contact/tangential_force.hpp"
#include "solvers/contact/tool_gap.hpp"
#include "src/base/process_settings.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/dropped_nodes.hpp"
#include "src/model/wall_bending.hpp"
#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"
#include "topology/incision/gap_walls.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double stretched_rotation = 10;        // degrees, beyond which linear elasticity is being stretched
constexpr double allowed_force_jump = 0.02;      // at a re-sprinkle
constexpr double same_place = 1e-6;              // of the fine spacing: a blade that has gone less has not moved
constexpr double rest_delay = 0.1;               // s without motion after which it is at rest
constexpr double stiffest_galerkin = 0.49;       // Poisson's ratio
constexpr int few_in_contact = 3;                // nodes
constexpr double least_nodes_through = 1;        // spacings through a wall, below which nothing is computed
constexpr double deep_press = 0.25;              // of the tip radius
constexpr double contact_crowded_by_sheet = 0.3; // of the fine spacing: nearer to a sheet no node of a contact is put

Organ timed_organ(const OrganSettings& settings, double& seconds) {
  const StageTimer timer(seconds);
  return make_organ(settings);
}

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

} // namespace

Session::Session(Scenario scenario, std::function<void(const std::string&)> say, Leader leader)
    : scenario_(std::move(scenario)), say_(std::move(say)), organ_(timed_organ(scenario_.organ, profile_.organ)),
      query_(organ_.domain->surface()) {
  interruption_point();
  if (leader == Leader::device)
    require_linear(scenario_.file, scenario_.law);
  use_one_blas_thread();
  for (const std::string& remark : organ_.remarks)
    warn(remark, remark);
  zone_ = fine_zone(scenario_, *organ_.domain);
  follow_walls();
  std::vector<ToolSample> motion;
  if (scenario_.tool) {
    motion = tool_motion_of(scenario_, query_, organ_.domain->bounds());
    touch_ = find_touch(motion, leader);
  }
  steps_ = schedule(scenario_, motion, zone_.spacing.fine, sheet_edge(zone_), topology::SweepOptions{}.most_triangles);
  if (scenario_.method.method == solvers::Method::published)
    warn("published", "the published scheme does not converge and its force is not one in newtons: see docs");
  if (scenario_.method.method == solvers::Method::galerkin && !is_nonlinear(scenario_.law) &&
      scenario_.material.poisson_ratio > stiffest_galerkin)
    warn("locking",
         fmt::format("method galerkin has no pressure of its own: at poisson_ratio = {:g}, above {:g}, it is "
                     "too stiff, by some percent at usual spacings; collocation is not",
                     scenario_.material.poisson_ratio, stiffest_galerkin));
  if (scenario_.tool && !touch_)
    warn("touch", "the tool never touches the organ on its way");
  if (cuts()) {
    const StageTimer timer(profile_.topology);
    incisions_ = std::make_unique<IncisionBuilder>(scenario_, organ_.domain, sheet_edge(zone_));
    model_.incision = incisions_->incision();
    for (const std::string& remark : incisions_->remarks())
      warn(remark, remark);
    incisions_->update_fields();
  }
  watch_blade_way();
  make_blade_force();
  toughness_ = toughness_field(scenario_);
  if (!computes())
    return;
  if (touch_)
    zone_contact_ = first_zone_ = centre_of(touch_->contact, touch_->pose);
  model_.touched_from = facing();
  find_gaps();
  lay_out_zone();
  if (!scenario_.precuts.empty())
    try {
      require_pieces(incisions_->wound(), zone_.spacing);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}:{}: {}", scenario_.file.string(), scenario_.precuts.front().line, error.what()));
    }
  try {
    judge_walls();
    if (const std::optional<std::string> front = coarse_front(scenario_, *organ_.domain, zone_))
      warn("front", *front);
    sprinkle(nullptr, model_);
  } catch (const InputError& error) { // what was odd about the organ may be why
    std::string all =
        fmt::format("{}: [nodes] fine_spacing and coarse_spacing: {}", scenario_.file.string(), error.what());
    for (const std::string& remark : organ_.remarks)
      all += "\n" + remark;
    throw InputError(all);
  }
  static_cast<void>(fixed_nodes(scenario_, *organ_.domain, model_.sprinkling.nodes));
  if (cuts()) // regions that hold nothing have been told by now: no piece is severed by that
    check_held(steps_.front().time);
  approach_hanging();
}

// The way of an approach counts from its first touch of the body as its loads hold it before the tool comes.
void Session::approach_hanging() {
  const bool is_loaded = scenario_.gravity || !scenario_.pretension.isZero() ||
                         std::any_of(scenario_.precuts.begin(), scenario_.precuts.end(),
                                     [](const PrecutSettings& precut) { return precut.pressure != 0; });
  if (!is_loaded || !can_run(scenario_) || !touch_ || !std::holds_alternative<Approach>(scenario_.tool->motion))
    return;
  if (is_nonlinear(scenario_.law)) {
    make_finite(model_);
    solve_finite(steps_.front().time, std::nullopt, model_);
  } else {
    assemble(model_, {}, candidates(model_));
    app::condense({}, model_);
    solve_contact(nullptr, nullptr, scenario_, model_);
  }
  topology::SurfaceMesh hanging = organ_.domain->surface();
  for (Vector3& x : hanging.vertices)
    x += at(x).displacement;
  model_.state.reset();
  seen_hanging_ = true;
  std::vector<ToolSample> motion;
  try {
    motion = tool_motion_of(scenario_, topology::ContactQuery(hanging), topology::bounds(hanging));
  } catch (const InputError& error) {
    throw InputError(fmt::format("{} (of the organ as its loads have moved it before the tool comes)", error.what()));
  }
  const Vector3 sag = motion.back().pose.point - steps_.back().tool->point;
  steps_ = schedule(scenario_, motion, zone_.spacing.fine, sheet_edge(zone_), topology::SweepOptions{}.most_triangles);
  say_(fmt::format("the loads move the tool's first touch by {:.3g} mm", 1e3 * sag.norm()));
}

// Where the tool meets the organ. A device may do so anywhere: it is expected where the path comes nearest.
std::optional<FirstTouch> Session::find_touch(const std::vector<ToolSample>& motion, Leader leader) const {
  if (scenario_.tool->grasp)
    return find_grasp(motion, leader);
  const std::optional<FirstTouch> touch = first_touch(*scenario_.tool, motion, query_);
  return touch || leader == Leader::path ? touch : nearest_approach(*scenario_.tool, motion, query_);
}

// Fine at the contact, at the fronts of the precuts, and where the blade is going to cut.
void Session::lay_out_zone() {
  if (zone_contact_)
    zone_.spacing.centres =
        is_nonlinear(scenario_.law) ? places_of_contact() : std::vector<Vector3>{zone_contact_->point};
  if (scenario_.blade)
    tracks_ = blade_tracks(*scenario_.blade, *organ_.domain, 2 * zone_.spacing.fine);
  zone_.spacing.segments = model_.incision != nullptr ? fine_segments(*model_.incision) : tracks_;
  if (!scenario_.precuts.empty())
    refine_small_pieces(incisions_->wound(), zone_.spacing);
  if (scenario_.nodes.count > 0)
    zone_.spacing =
        solvers::spacing_for_count(*organ_.domain, zone_.spacing, scenario_.nodes.count, sprinkle_options(model_));
}

// Gaps that the coarsest spheres would bridge: the nodes become finer and coarser as the fine zone goes along.
void Session::find_gaps() {
  if (!walls_.narrowest)
    return;
  gap_walls_ = topology::gap_walls(organ_.domain, [h = zone_.spacing.coarse](const Vector3&) { return h; });
  if (gap_walls_ != nullptr && cut_appends(scenario_)) {
    scenario_.cut.sight = solvers::SightRule::enriched;
    warn("gaps", "cut.sight = \"appended\" takes spheres that see through the narrow gaps of this organ: \"enriched\" "
                 "is used");
  }
}

// Where neither the coarsest spacing nor a number of nodes is given, the derived one follows the walls.
void Session::follow_walls() {
  const double coarse = zone_.spacing.coarse;
  walls_ = measure_walls(*organ_.domain, coarse / 3, coarse);
  if (scenario_.nodes.coarse_spacing <= 0 && scenario_.nodes.count <= 0)
    app::follow_walls(walls_, *organ_.domain, wall_budget, zone_.spacing);
}

void Session::judge_walls() {
  // Three nodes through a wall do for the weak form; collocation bends by a tenth too little with one more.
  constexpr double through_by_collocation = 3;
  const bool is_stiff = scenario_.method.method == solvers::Method::collocation;
  std::optional<CoarseWall> wall = coarsest_wall(walls_, zone_.spacing);
  const bool has_three = !wall;
  if (has_three && is_stiff)
    wall = coarsest_wall(walls_, zone_.spacing, through_by_collocation);
  if (!wall)
    return;
  const std::string what = fmt::format(
      "the wall at [{:.4g}, {:.4g}, {:.4g}] m is {:.3g} mm thick and the nodes there are {:.3g} mm apart: {}",
      wall->place.x(), wall->place.y(), wall->place.z(), 1e3 * wall->thickness, 1e3 * wall->spacing,
      bending_error(wall->nodes_through(), scenario_.method.method));
  const std::string remedy =
      has_three ? "Method galerkin errs by a quarter of that at most"
                : fmt::format("nodes.coarse_spacing = {:.2g} m puts three nodes through it", wall->wanted);
  if (wall->nodes_through() < least_nodes_through)
    throw InputError(
        fmt::format("{}; allowed: at most {:.2g} m there. {}", what, wall->thickness / least_nodes_through, remedy));
  warn("walls", fmt::format("{}. {}", what, remedy));
}

topology::SurfaceContact Session::find_contact(const topology::ToolPose& pose) const {
  const topology::ToolShape& shape = scenario_.tool->shape;
  if (scenario_.tool->grasp)
    return query_.first_touch(shape, pose);
  return last_contact_ ? query_.walk(shape, pose, *last_contact_) : query_.first_touch(shape, pose);
}

// Where fine nodes belong: at the contact; under a flat punch, whose deepest point may be anywhere on its end, below
// the middle of that.
topology::SurfaceContact Session::centre_of(const topology::SurfaceContact& contact,
                                            const topology::ToolPose& pose) const {
  const auto* punch = std::get_if<topology::FlatPunch>(&scenario_.tool->shape);
  if (punch == nullptr)
    return contact;
  topology::SurfaceContact centre = contact;
  centre.point = organ_.domain->closest_surface_point(pose.point);
  centre.normal = organ_.domain->normal(centre.point);
  const bool below = (centre.point - contact.point).norm() < 1.5 * punch->radius && centre.normal.dot(pose.axis) > 0.5;
  return below ? centre : contact;
}

StepResult Session::step(const StepSample& sample) {
  StepResult result;
  result.time = sample.time;
  const auto start = std::chrono::steady_clock::now();
  if (sample.tool) {
    result.pose = *sample.tool;
    result.contact = find_contact(*sample.tool);
    last_contact_ = result.contact;
  }
  if (is_nonlinear(scenario_.law))
    step_finite(sample, result);
  else
    step_linear(sample, result);
  passed_.clear();
  if (result.cut)
    report_cut(*result.cut);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

void Session::step_linear(const StepSample& sample, StepResult& result) {
  if (cuts())
    result.cut = aside_cut_.value_or(CutReport{});
  Loading loading{.releases = begin_step(sample)};
  const std::optional<topology::BladePose> last_blade = last_blade_;
  const bool solved = cut_freely(sample, result);
  if (sample.blade)
    last_blade_ = sample.blade;
  // Without any load the organ keeps its rest shape until the tool is on it.
  const bool touched = touch_ && (scenario_.tool->grasp ? grasps() : result.contact.depth > 0);
  const bool loaded =
      has_loads() ||
      ((touch_ || cuts()) && (touched || model_.body != nullptr || model_.incision != nullptr || blade_enters(sample)));
  if (loaded) {
    if (model_.body == nullptr)
      build(model_);
    if (!solved)
      solve(sample, model_);
    if (touch_)
      follow_tool(sample, result);
    loading.cut_surface = press_resisted(sample, result);
    if (tears())
      tear(sample, loading, result);
    if (renews_windows() && sample.blade)
      watch_window(sample, last_blade, result);
    evaluate(result);
  } else if (blade_force_ != nullptr && sample.blade) {
    press_blade(sample, *result.cut); // it is outside: from here on its way goes into the tissue
  }
  result.resprinkled = result.resprinkled || std::exchange(followed_aside_, false);
  result.rebuild = std::exchange(rebuild_, Rebuild::none);
}

// What the last step has left, the grasper, and whether the blade rests. True: the grasper has let go.
bool Session::begin_step(const StepSample& sample) {
  const auto kept = std::exchange(kept_grip_, std::nullopt);
  grip_memory_ = model_.state ? remembered_grip() : kept;
  if (without_blade_) {
    model_.field = std::move(*without_blade_);
    without_blade_.reset();
  }
  if (sample.blade && !cuts_aside())
    drop_following();
  const bool released = handle_grasper(sample);
  if (sample.blade && (!last_blade_ || edge_travel(scenario_.blade->edge, *last_blade_, *sample.blade) >
                                           same_place * zone_.spacing.fine))
    blade_moved_ = sample.time;
  blade_rests_ = !sample.blade || sample.time - blade_moved_ >= rest_delay;
  return released;
}

// A blade that nothing resists cuts before the step is solved. True: it is solved already.
bool Session::cut_freely(const StepSample& sample, StepResult& result) {
  if (incisions_ == nullptr || blade_force_ != nullptr)
    return false;
  bool solved = false;
  if (model_.body != nullptr && !model_.state && (sample.blade || aside_cut_)) { // by its field a blade is carried
    solve(sample, model_);                                                       // to the tissue at rest
    solved = true;
  }
  aside_cut_.reset();
  return move_blade(sample, *result.cut) || solved;
}

// Fine nodes go along with the tool.
void Session::follow_tool(const StepSample& sample, StepResult& result) {
  const topology::SurfaceContact centre = centre_of(result.contact, result.pose);
  const bool waits = cuts_aside() && !leaves_zone(centre); // nodes are made at one place at a time
  if (!must_follow(centre) || waits)
    return;
  if (following_aside_ && recondensing_ == nullptr && !sample.blade && !cuts_aside()) {
    follow_aside(sample, centre);
    return;
  }
  if (cuts_aside())
    wait_for_cut(sample, *result.cut);
  follow(sample, centre, result);
}

// A blade that the tissue resists, against the solved body. Returns the energy of the surface that it cuts, J.
double Session::press_resisted(const StepSample& sample, StepResult& result) {
  if (blade_force_ != nullptr && sample.blade)
    return press_blade(sample, *result.cut);
  if (!last_blade_ || !(proposing_ || (proposes_aside() && blade_force_->lags())))
    return 0;
  StepSample left = sample; // at the end of its path, with a cut still to come
  left.blade = last_blade_;
  left.blade->time = sample.time;
  return press_blade(left, *result.cut);
}

// What friction has to know of the solution, should the nodes change.
std::optional<solvers::GripMemory> Session::remembered_grip() const {
  if (scenario_.contact.condition != solvers::ContactCondition::frictional || !model_.state || grasps() ||
      model_.patch.nodes.empty())
    return std::nullopt;
  return solvers::remember(model_.patch, model_.state->tool, scenario_.contact.friction);
}

void Session::prepare(const StepSample& sample) {
  if (is_nonlinear(scenario_.law)) {
    if (computes() && model_.finite == nullptr)
      make_finite(model_);
    return;
  }
  if (!computes() || (model_.body != nullptr && !std::exchange(seen_hanging_, false)))
    return;
  if (sample.tool)
    last_contact_ = find_contact(*sample.tool);
  if (model_.body == nullptr)
    build(model_);
  if (touch_ && !scenario_.tool->grasp && model_.patch.nodes.empty())
    condense(candidates(model_), model_);
  if (!renews_windows() || scenario_.blade->advance.value_or(1) > 0) // in the loop it may be made beside the steps
    return;
  StepSample meeting = sample;
  if (!meeting.blade)
    if (const auto first = std::find_if(steps_.begin(), steps_.end(), [](const StepSample& s) { return !!s.blade; });
        first != steps_.end())
      meeting = *first;
  if (!meeting.blade)
    return;
  meet_blade(meeting, std::nullopt);
  if (recondensing_ != nullptr)
    swap_body();
}

void Session::coarsen(double factor) {
  if (!(factor > 0) || !std::isfinite(factor))
    throw InputError(fmt::format("spacings {:g} times those of the scenario; allowed: above 0", factor));
  zone_.spacing.fine *= factor / coarseness_;
  zone_.spacing.coarse *= factor / coarseness_;
  coarseness_ = factor;
  led_segments_.clear();
}

// A bonded contact stays with its nodes, so its zone stays too.
bool Session::must_follow(const topology::SurfaceContact& contact) const {
  if (scenario_.contact.condition == solvers::ContactCondition::bonded || scenario_.tool->grasp || contact.depth <= 0)
    return false;
  const double away = (contact.point - zone_contact_->point).norm();
  return away > scenario_.contact.follow_fraction * zone_.spacing.radius;
}

bool Session::leaves_zone(const topology::SurfaceContact& contact) const {
  return (contact.point - zone_contact_->point).norm() > zone_.spacing.radius;
}

// Centres of the fine zone lie on a lattice about the first one, as far apart as the contact may leave a centre. So the
// zone goes through the same places, with the same nodes, however often the way is looked at: a session that solves now
// and then has the body of one that solves all the time. A flat punch wants its rings where it is.
topology::SurfaceContact Session::next_zone(const topology::SurfaceContact& contact) const {
  if (std::holds_alternative<topology::FlatPunch>(scenario_.tool->shape))
    return contact;
  const double pitch = scenario_.contact.follow_fraction * zone_.spacing.radius;
  const Vector3 cell = ((contact.point - first_zone_->point) / pitch).array().round();
  topology::SurfaceContact zone = contact;
  zone.point = organ_.domain->closest_surface_point(first_zone_->point + pitch * cell);
  zone.normal = organ_.domain->normal(zone.point);
  const bool near = (zone.point - contact.point).norm() < 0.9 * pitch && zone.normal.dot(contact.normal) > 0.5;
  return near ? zone : contact;
}

void Session::follow(const StepSample& sample, const topology::SurfaceContact& centre, StepResult& result) {
  const Vector3 before = model_.state->tool.tool_force;
  say_(fmt::format("the fine zone follows the tool, t = {:g} s", sample.time));
  rebuild_ = Rebuild::in_step;
  zone_contact_ = next_zone(centre);
  zone_.spacing.centres = {zone_contact_->point};
  BodyModel next;
  next.touched_from = facing();
  next.incision = model_.incision;
  sprinkle(&model_.sprinkling.nodes, next);
  build(next);
  solve(sample, next);
  model_ = std::move(next);
  result.resprinkled = true;
  const Vector3& after = model_.state->tool.tool_force;
  result.force_jump = before.norm() > 0 ? (after - before).norm() / before.norm() : 0;
  if (result.force_jump > allowed_force_jump)
    warn(force_only_ ? "jump" : fmt::format("jump at {:g} s", sample.time),
         fmt::format("the force jumped by {:.1f} % at a re-sprinkle (t = {:g} s); finer nodes or a larger fine "
                     "radius bring it under {:g} %",
                     100 * result.force_jump, sample.time, 100 * allowed_force_jump));
}

solvers::SprinkleOptions Session::sprinkle_options(const BodyModel& model) const {
  solvers::SprinkleOptions options;
  options.spacing = zone_.spacing;
  if (grasp_)
    options.seeds = grasp_->nodes;
  else if (zone_contact_)
    options.seeds = contact_seeds(scenario_, *organ_.domain, *zone_contact_, zone_.spacing.fine);
  if (model.incision != nullptr) // nodes on it belong to one of its faces
    std::erase_if(options.seeds, [&](const solvers::SeedNode& seed) {
      return model.incision->closest(seed.position, contact_crowded_by_sheet * zone_.spacing.fine).has_value();
    });
  options.random_seed = scenario_.nodes.random_seed;
  options.incision = model.incision;
  options.walls = gap_walls_;
  options.ring_ahead = solvers::wants_ring_ahead(scenario_.method.method);
  options.lips_apart = cut_appends(scenario_);
  return options;
}

void Session::sprinkle(const solvers::NodeCloud* previous, BodyModel& model) {
  const StageTimer timer(profile_.sprinkle);
  const solvers::SprinkleOptions options = sprinkle_options(model);
  model.sprinkling = previous == nullptr ? solvers::sprinkle(*organ_.domain, options)
                                         : resprinkle_held(scenario_, *organ_.domain, options, *previous);
  model.coarseness = coarseness_;
}

std::vector<int> Session::candidates(const BodyModel& model) const {
  if (scenario_.tool->grasp)
    return grasped_nodes(model);
  return touchable_nodes(scenario_, *organ_.domain, model.sprinkling.nodes, *zone_contact_, zone_.candidate_radius);
}

// Where the tool comes from; a grasper holds what is between its jaws.
std::optional<Vector3> Session::facing() const {
  if (!zone_contact_ || !scenario_.tool || scenario_.tool->grasp)
    return std::nullopt;
  return zone_contact_->normal;
}

// Whether the tool can be on the surface, as far as that has moved by now.
bool Session::tool_in_reach() const {
  if (!touch_ || !last_contact_)
    return false;
  if (scenario_.tool->grasp)
    return grasps();
  double moved = 0;
  for (Eigen::Index i = 0; i + 2 < node_displacements_.size(); i += 3)
    moved = std::max(moved, node_displacements_.segment<3>(i).norm());
  return last_contact_->depth > -(2 * moved + zone_.spacing.radius + topology::tip_radius(scenario_.tool->shape));
}

void Session::build(BodyModel& model) {
  const std::vector<int> near = tool_in_reach() ? candidates(model) : std::vector<int>{};
  assemble(model, {}, near);
  condense(near, model);
}

void Session::assemble(BodyModel& model, const topology::SurfaceMesh& way_ahead, const std::vector<int>& near) {
  const StageTimer timer(profile_.discretise);
  drop_recondensing();
  drop_following();
  app::assemble(scenario_, organ_.domain, model, way_ahead, near);
  const solvers::SprinkleReport& report = model.sprinkling.report;
  say_(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed",
                   model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes, report.lip_nodes,
                   held_nodes(model.body->problem().prescribed)));
}

void Session::condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) {
  interruption_point();
  const StageTimer timer(profile_.condense);
  app::condense(without_dropped(candidates, scenario_, *model.body), model, for_few_presses);
}

// Below where the surface would be without the tool, m: loads and pretension may have drawn it away.
double Session::depth_of_press(const topology::SurfaceContact& contact) const {
  const std::vector<Vector3>& rest = model_.patch.rest;
  if (rest.empty())
    return contact.depth;
  const auto nearest = std::min_element(rest.begin(), rest.end(), [&](const Vector3& a, const Vector3& b) {
    return (a - contact.point).squaredNorm() < (b - contact.point).squaredNorm();
  });
  return contact.depth + contact.normal.dot(model_.patch.base_displacement.segment<3>(3 * (nearest - rest.begin())));
}

void Session::evaluate(StepResult& result) {
  const StageTimer timer(profile_.evaluate);
  const solvers::ContactState& tool = model_.state->tool;
  result.force = tool.tool_force;
  result.torque = tool.tool_torque;
  result.tangential = solvers::tangential_force(
      model_.patch, tool, grasps() ? solvers::ContactCondition::bonded : scenario_.contact.condition);
  result.contact_radius = tool.contact_radius;
  result.active_nodes = tool.active_nodes;
  result.candidates = static_cast<int>(model_.patch.nodes.size());
  result.nodes = model_.sprinkling.nodes.size();
  result.iterations = tool.iterations;
  result.converged = tool.converged;
  result.largest_penetration = penetration_ ? penetration_->deepest : tool.largest_penetration;
  node_displacements_ = displacements_of(model_);
  if (!force_only_)
    result.residual = residual(model_);
  if (blade_force_ != nullptr) {
    solvers::Field bladed = blade_force_->field(model_);
    without_blade_ = std::exchange(model_.field, std::move(bladed));
  }
  if (!result.force.allFinite())
    throw NumericalError(fmt::format("the tool force at t = {:g} s is not finite; residual {:.1e}, condition estimate "
                                     "{:.1e}",
                                     result.time, result.residual, model_.body->report().condition_estimate));
  node_states_.clear();
  if (!force_only_)
    evaluate_nodes(result);
  if (!result.converged)
    warn("contact", fmt::format("the contact did not converge at t = {:g} s: {:.2g} m of penetration left", result.time,
                                result.largest_penetration));
  if (penetration_ && penetration_->deepest > most_left_over * penetration_->spacing)
    warn(penetration_->pushed ? "surface" : "held surface",
         fmt::format("the surface lies {:.2g} m in the tool at [{:.4g}, {:.4g}, {:.4g}] m, t = {:g} s: {:.0f} % of the "
                     "nodes' spacing there, allowed {:g} %; {}",
                     penetration_->deepest, penetration_->place.x(), penetration_->place.y(), penetration_->place.z(),
                     result.time, 100 * penetration_->deepest / penetration_->spacing, 100 * most_left_over,
                     penetration_->pushed
                         ? "finer nodes at the contact follow the tool"
                         : "a fixed region holds it there against the tool, whose force is too small"));
  result.self_penetration = model_.passed_through.depth;
  if (const BodyModel::PassedThrough& passed = model_.passed_through; passed.depth > most_left_over * passed.spacing) {
    const bool is_open = scenario_.cut.lips == solvers::LipCondition::open;
    warn(is_open ? "passes open" : "passes",
         fmt::format("the organ's surface passes through itself by {:.2g} m at [{:.4g}, {:.4g}, {:.4g}] m, t = {:g} s: "
                     "{}",
                     passed.depth, passed.place.x(), passed.place.y(), passed.place.z(), result.time,
                     is_open ? "cut.lips = \"open\" leaves the contact of its parts out"
                             : "its parts push on one another from node to node, and the nodes do not tell it finer"));
  }
  judge_fineness(result);
  if (!model_.state->lips.converged)
    warn("lips", fmt::format("the contact of the lips did not converge at t = {:g} s", result.time));
}

// Where that deep a tip touches one or two nodes, its force is that of these nodes' places.
void Session::judge_fineness(const StepResult& result) {
  const double depth = touch_ ? depth_of_press(result.contact) : 0;
  if (touch_ && !scenario_.tool->grasp && result.active_nodes < few_in_contact &&
      (result.active_nodes > 0 || model_.incision == nullptr) &&
      depth > deep_press * topology::tip_radius(scenario_.tool->shape))
    warn("coarse",
         fmt::format("the tool is {:.2g} m deep at t = {:g} s and touches {} of the surface's nodes: {:.2g} m "
                     "between nodes are too coarse for a tip of {:.2g} m; nodes.fine_spacing or nodes.count "
                     "make them finer",
                     depth, result.time, result.active_nodes, zone_.spacing.fine,
                     topology::tip_radius(scenario_.tool->shape)));
}

solvers::PointState Session::at(const Vector3& x) const {
  return model_.at(x);
}

void Session::evaluate_nodes(StepResult& result) {
  double farthest = 0; // m, that a node moves
  Vector3 place = Vector3::Zero();
  for (const Vector3& x : model_.sprinkling.nodes.positions) {
    node_states_.push_back(model_.body->at(x, model_.field));
    const Matrix3& gradient = node_states_.back().gradient;
    const Matrix3 skew = 0.5 * (gradient - gradient.transpose());
    const double angle = Vector3(skew(2, 1), skew(0, 2), skew(1, 0)).norm() * 180 / std::numbers::pi;
    result.rotation_degrees = std::max(result.rotation_degrees, angle);
    if (const double moved = node_states_.back().displacement.norm(); !std::isnan(farthest) && !(moved <= farthest)) {
      farthest = moved;
      place = x;
    }
  }
  if (const double size = organ_.domain->bounds().extent().norm(); !(farthest <= size))
    warn("astray",
         fmt::format("tissue at [{:.4g}, {:.4g}, {:.4g}] m moves by {:.3g} m at t = {:g} s, farther than the organ's "
                     "size of {:.3g} m: it hangs by next to nothing, or its loads are far too large; what is computed "
                     "of it is of no use",
                     place.x(), place.y(), place.z(), farthest, result.time, size));
  if (result.rotation_degrees > stretched_rotation)
    warn("rotation",
         fmt::format("tissue rotates by {:.0f} degrees at t = {:g} s (over {:g}): linear elasticity is being "
                     "stretched",
                     result.rotation_degrees, result.time, stretched_rotation));
}

void Session::warn(const std::string& key, const std::string& text) {
  if (std::find(warned_.begin(), warned_.end(), key) != warned_.end())
    return;
  warned_.push_back(key);
  warnings_.push_back(text);
  say_("warning: " + text);
}

} // namespace spherecut::app
