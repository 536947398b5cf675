#include "src/tissue/contact_solver.hpp"

#include "solvers/contact/tool_gap.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/dropped_nodes.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr int patch_growths = 6;      // in one step
constexpr double kept_depth = 0.01;   // of its spacing: what a share that is lifted is left in the tool
constexpr double kept_lift = 0.01;    // of its spacing: a share as deep is lifted along with those that must be
constexpr int most_lifts = 12;        // rounds in one step
constexpr int candidates_a_press = 4; // whose fields are made beside a press
constexpr int pairs_a_press = 4;      // of lips, likewise
bool is_any_closed(const solvers::LipState& lips) {
  return std::find(lips.closed.begin(), lips.closed.end(), 1) != lips.closed.end();
}

} // namespace

ContactSolver::ContactSolver(SessionState& state, const Grasping& grasping, const BladeTrack& blade,
                             const BackgroundBodies& background)
    : state_(state), scenario_(state.scenario), organ_(state.organ), zone_(state.zone), grasping_(grasping),
      blade_(blade), background_(background) {}

void ContactSolver::begin_step() {
  const auto kept = std::exchange(kept_grip_, std::nullopt);
  grip_memory_ = state_.model.state ? remembered_grip() : kept;
}

void ContactSolver::keep_grip() {
  kept_grip_ = remembered_grip();
}

void ContactSolver::go_on_with_kept_grip() {
  if (!state_.model.state)
    grip_memory_ = std::exchange(kept_grip_, std::nullopt);
}

std::optional<solvers::GripMemory> ContactSolver::remembered_grip() const {
  if (scenario_.contact.condition != solvers::ContactCondition::frictional || !state_.model.state ||
      grasping_.holds() || state_.model.patch.nodes.empty())
    return std::nullopt;
  return solvers::remember(state_.model.patch, state_.model.state->tool, scenario_.contact.friction);
}

bool ContactSolver::is_in_reach() const {
  if (!state_.touch || !state_.contact)
    return false;
  if (scenario_.tool->grasp)
    return grasping_.holds();
  double moved = 0;
  for (Eigen::Index i = 0; i + 2 < state_.displacements.size(); i += 3)
    moved = std::max(moved, state_.displacements.segment<3>(i).norm());
  return state_.contact->depth > -(2 * moved + zone_.spacing().radius + topology::tip_radius(scenario_.tool->shape));
}

std::vector<int> ContactSolver::candidates(const BodyModel& model) const {
  if (scenario_.tool->grasp)
    return grasping_.nodes(model, zone_.fine());
  return touchable_nodes(scenario_, *organ_.domain, model.sprinkling.nodes, *zone_.centre(),
                         zone_.zone().candidate_radius);
}

std::vector<int> ContactSolver::candidates_in_reach(const BodyModel& model) const {
  return is_in_reach() ? candidates(model) : std::vector<int>{};
}

void ContactSolver::solve_beside(const StepSample& sample, BodyModel& model) {
  std::optional<SurfaceWatch::Depths> penetration = penetration_;
  const bool lips_touch = lips_touch_;
  solve(sample, model);
  penetration_ = std::move(penetration);
  lips_touch_ = lips_touch;
}

void ContactSolver::condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) {
  interruption_point();
  const StageTimer timer(state_.profile.condense);
  app::condense(without_dropped(candidates, scenario_, *model.body), model, for_few_presses);
}

void ContactSolver::solve(const StepSample& sample, BodyModel& model) {
  if (model.finite != nullptr) {
    solve_finite(sample.time, sample.tool, model, state_.profile);
    if (state_.leader == Leader::device)
      condense_finite(model);
    return;
  }
  displaced_body_ = nullptr;
  if (is_in_reach() && model.patch.nodes.empty())
    condense(candidates(model), model);
  const topology::ToolPose* pose = sample.tool ? &*sample.tool : nullptr;
  if (grasping_.holds()) {
    const StageTimer timer(state_.profile.press);
    press(pose, model);
    extend_fields(model);
    return;
  }
  for (int growth = 0; growth <= patch_growths; ++growth) {
    const std::vector<int> missed = press_surface(pose, model);
    if (missed.empty()) {
      extend_fields(model);
      return;
    }
    std::vector<int> grown = model.patch.nodes;
    grown.insert(grown.end(), missed.begin(), missed.end());
    std::sort(grown.begin(), grown.end());
    std::optional<solvers::CutContactState> bonded;
    if (scenario_.contact.condition == solvers::ContactCondition::bonded) // what is held goes on being held
      bonded = solvers::CutContactState{solvers::among(model.patch, model.state->tool, grown), model.state->lips};
    condense(grown, model);
    model.state = std::move(bonded);
  }
  state_.log.warn("patch",
                  "the tool reaches surface nodes beyond its candidate patch; give a larger contact.candidate_radius");
}

// From the model's state, if it has one.
void ContactSolver::press(const topology::ToolPose* pose, BodyModel& model) {
  const ToolSettings* tool = scenario_.tool ? &*scenario_.tool : nullptr;
  if (grasping_.holds()) {
    const std::vector<Vector3> held = grasping_.displacements(*pose, model);
    solve_contact(tool, pose, scenario_, model, &held, std::nullopt, lips_touch_);
  } else {
    solve_contact(tool, pose, scenario_, model, nullptr, grip_memory_, lips_touch_);
  }
  lips_touch_ = is_any_closed(model.state->lips);
}

// Contact on the surface itself: where a share lies deeper in the tool than may be left over, although its mean does
// not, its gap is lifted by as much, until what is left of every share is within the limit and no share that was lifted
// stands off. Returns the nodes that the tool has gone into although they are no candidates.
std::vector<int> ContactSolver::press_surface(const topology::ToolPose* pose, BodyModel& model) {
  const StageTimer timer(state_.profile.press);
  penetration_.reset();
  const std::optional<solvers::CutContactState> before = model.state;
  solvers::ContactPatch& patch = model.patch;
  press(pose, model);
  if (patch.nodes.empty())
    return {};
  if (std::vector<int> missed = penetrated_outside_patch(*pose, model); !missed.empty())
    return missed;
  // The published method has no surface between its nodes. In the haptic loop the ticks between two solves have the
  // same contact as these, on the means alone: a lift that each solve finds anew would be a step of the force.
  if (scenario_.method.method == solvers::Method::published || state_.options.force_only)
    return {};
  if (!model.watch)
    model.watch.emplace(model, *organ_.domain, zone_.fine(), dropped_nodes(scenario_, *model.body));
  for (int round = 0;; ++round) {
    penetration_ = model.watch->depths(scenario_.tool->shape, *pose, model.field, most_left_over);
    std::vector<int> beyond = touchable(penetration_->beyond, *pose, model);
    if (!beyond.empty())
      return beyond;
    if (round == most_lifts || !lift_shares(*penetration_, *pose, model))
      return {};
    model.state = before;
    press(pose, model);
  }
}

// Whether lifts had to change.
bool ContactSolver::lift_shares(const SurfaceWatch::Depths& depths, const topology::ToolPose& pose,
                                BodyModel& model) const {
  solvers::ContactPatch& patch = model.patch;
  patch.lifts.resize(patch.nodes.size(), 0);
  const solvers::PressingTool pressing = solvers::pressing(scenario_.tool->shape, pose, patch.rest, patch.normals);
  bool stands = true;
  std::vector<double> lifts = patch.lifts;
  for (std::size_t c = 0; c < lifts.size(); ++c) {
    const double spacing = patch.spacings[c];
    const double depth = depths.of_candidates[c];
    const bool lies_deep = depth > most_left_over * spacing;
    const bool stands_off = lifts[c] > 0 && depth < 0;
    stands = stands && !lies_deep && !stands_off;
    if (depth > kept_lift * spacing || lifts[c] > 0) {
      // A share that does not touch is lifted to where it does first.
      const Vector3 u = model.state->tool.displacement.segment<3>(3 * static_cast<Eigen::Index>(c));
      const double gap = solvers::contact_gap(pressing, patch.rest[c] + u).distance;
      const double from = model.state->tool.active[c] != 0 || depth < 0 ? lifts[c] : std::max(lifts[c], gap);
      lifts[c] = std::max(0.0, from + depth - kept_depth * spacing);
    }
  }
  if (!stands)
    patch.lifts = std::move(lifts);
  return !stands;
}

// Those of the nodes that a tool at the pose can push.
std::vector<int> ContactSolver::touchable(std::vector<int> nodes, const topology::ToolPose& pose,
                                          const BodyModel& model) const {
  if (nodes.empty())
    return nodes;
  const solvers::NodeCloud& cloud = model.sprinkling.nodes;
  const std::vector<std::array<bool, 3>> held = held_axes(model.body->problem().prescribed, cloud.size());
  std::erase_if(nodes, [&](int i) {
    return !gives_way(held[i], topology::tool_normal(scenario_.tool->shape, pose, cloud.positions[i]));
  });
  return nodes;
}

// A loop in real time presses on while the blade rests: superposed fields are cheaper than a solution each time.
void ContactSolver::extend_fields(BodyModel& model) const {
  const bool is_for_good =
      blade_.rests() || (blade_.put_off() == 0 && !background_.follows_cut()); // else the next body is on its way
  const bool bare_patch = !solvers::has_fields(model.patch);
  const bool bare_lips = lips_touch_ && model.lips && !solvers::has_fields(*model.lips);
  if (!state_.options.force_only || !is_for_good || (!bare_patch && !bare_lips) || ++model.presses <= few_presses)
    return;
  if (bare_patch)
    solvers::extend_responses(*model.body, candidates_a_press, model.patch);
  else
    solvers::extend_responses(*model.body, pairs_a_press, *model.lips);
}

// What a loop gets between two solves.
void ContactSolver::condense_finite(BodyModel& model) const {
  model.patch = {};
  model.state.reset();
  if (!is_in_reach())
    return;
  const StageTimer timer(state_.profile.condense);
  model.finite->condense(candidates(model), model.patch, model.state.emplace().tool);
}

const VectorX& ContactSolver::displacements(const BodyModel& model) {
  const VectorX& coefficients = model.field.coefficients;
  if (model.finite != nullptr || displaced_body_ != model.body.get() ||
      displaced_coefficients_.size() != coefficients.size() || displaced_coefficients_ != coefficients) {
    displaced_ = model.nodal_displacements();
    displaced_coefficients_ = coefficients;
    displaced_body_ = model.body.get();
  }
  return displaced_;
}

// Surface nodes that the tool has gone into although they were not candidates.
std::vector<int> ContactSolver::penetrated_outside_patch(const topology::ToolPose& pose, const BodyModel& model) {
  const solvers::NodeCloud& nodes = model.sprinkling.nodes;
  std::vector<char> known = dropped_nodes(scenario_, *model.body);
  known.resize(nodes.positions.size(), 0);
  for (const int node : model.patch.nodes)
    known[node] = 1;
  // A share of the surface moves about as its node does: the mean over it is looked at near the tool alone.
  const VectorX& moved = displacements(model);
  const auto near = [&](int i) {
    return topology::tool_distance(scenario_.tool->shape, pose, nodes.positions[i] + moved.segment<3>(3 * i)) <
           zone_.fine();
  };
  std::vector<int> missed;
  for (int i = 0; i < nodes.size(); ++i)
    if (on_surface(nodes.kinds[i]) && known[i] == 0 && near(i) &&
        topology::tool_distance(scenario_.tool->shape, pose,
                                model.body->contact_point(i) + model.body->contact_displacement(i, model.field)) <
            -most_left_over * zone_.fine())
      missed.push_back(i);
  return touchable(std::move(missed), pose, model);
}

} // namespace spherecut::app
