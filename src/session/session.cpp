#include "src/session/session.hpp"

#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/session/blade_cutting.hpp"
#include "src/session/finite_grip.hpp"
#include "src/session/finite_stepper.hpp"
#include "src/session/setting_out.hpp"
#include "src/session/step_report.hpp"
#include "src/session/tear_propagation.hpp"
#include "src/session/tool_following.hpp"
#include "src/tissue/finite_body.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <utility>

namespace spherecut::app {

/// What a session is made of, each after those that it works on. A step goes through them from contact to force.
struct Session::Parts {
  Parts(Scenario scenario, std::function<void(const std::string&)> say, Leader leader)
      : state(std::move(scenario), std::move(say), leader) {}

  void step(const StepSample& sample, std::vector<topology::BladePose> passed, StepResult& result);
  void step_linear(const StepSample& sample, std::vector<topology::BladePose> passed, StepResult& result);
  void step_finite(const StepSample& sample, std::vector<topology::BladePose> passed, StepResult& result);
  [[nodiscard]] bool may_follow_finite();
  [[nodiscard]] topology::SurfaceContact find_contact(const topology::ToolPose& pose) const;
  void look_without_blade();
  bool begin(const StepSample& sample, std::vector<topology::BladePose> passed);
  bool grasp(const StepSample& sample);
  bool take_hold(const StepSample& sample);
  bool cut_freely(const StepSample& sample, bool another_body, StepResult& result);
  [[nodiscard]] bool is_loaded(const StepSample& sample, const StepResult& result) const;
  void follow_tool(const StepSample& sample, StepResult& result);
  [[nodiscard]] CutPolicy policy() const { return cut_policy(state.scenario, state.options); }

  SessionState state;
  BladeTrack blade{state.scenario};
  Grasping grasping{state.scenario, *state.organ.domain};
  BackgroundBodies background;
  ContactSolver contact{state, grasping, blade, background};
  BodyUpdater updater{state, contact, grasping, background};
  ToolFollowing tool{state, contact, updater, background};
  BladeCutting cutting{state, blade, contact, grasping, background, updater};
  TearFronts fronts{state.scenario, state.toughness, state.zone.zone()};
  std::unique_ptr<ResistedBlade> resisted; // null: nothing resists the blade
  std::unique_ptr<TearPropagation> tears;  // null: nothing tears
  StepReport report{state, contact, grasping};
  FiniteStepper finite{state, contact};
  bool has_hung = false; // the body has been built for approach_hanging() alone
};

Session::Session(Scenario scenario, std::function<void(const std::string&)> say, Leader leader)
    : parts_(std::make_unique<Parts>(std::move(scenario), std::move(say), leader)) {
  Parts& of = *parts_;
  set_out(of.state, leader);
  if (resists(of.state.scenario))
    of.resisted = std::make_unique<ResistedBlade>(of.state, of.blade, of.contact, of.background, of.updater, of.fronts);
  if (of.state.scenario.tearing.enabled)
    of.tears = std::make_unique<TearPropagation>(of.state, of.grasping, of.contact, of.background, of.updater,
                                                 of.fronts, of.resisted.get());
  if (!computes())
    return;
  lay_first_nodes(of.state, of.updater);
  of.has_hung = approach_hanging(of.state, of.updater);
}

Session::~Session() = default;

StepResult Session::step(const StepSample& sample, std::vector<topology::BladePose> passed) {
  StepResult result;
  {
    const StageTimer timer(result.seconds);
    parts_->step(sample, std::move(passed), result);
  }
  return result;
}

void Session::Parts::step(const StepSample& sample, std::vector<topology::BladePose> passed, StepResult& result) {
  result.time = sample.time;
  if (sample.tool) {
    const StageTimer timer(result.stages.contact);
    result.pose = *sample.tool;
    result.contact = find_contact(*sample.tool);
    state.contact = result.contact;
  }
  if (is_nonlinear(state.scenario.law))
    try {
      step_finite(sample, std::move(passed), result);
    } catch (const NumericalError& error) {
      const std::string told = without_equilibrium(state, sample.time, sample.blade.has_value(), error);
      throw NumericalError(state.leader == Leader::path ? told + ". The rows up to then are kept" : told);
    }
  else
    step_linear(sample, std::move(passed), result);
  if (result.cut) {
    const StageTimer timer(result.stages.force);
    report.tell_cut(resisted.get(), *result.cut);
  }
}

void Session::Parts::step_linear(const StepSample& sample, std::vector<topology::BladePose> passed,
                                 StepResult& result) {
  StageSeconds& stages = result.stages;
  const auto timed = [](double& stage, auto&& act) {
    const StageTimer timer(stage);
    return act();
  };
  const std::optional<CutReport> taken = cutting.take_report();
  if (has_cuts(state.scenario))
    result.cut = taken.value_or(CutReport{});
  Loading loading;
  loading.releases = timed(stages.solve, [&] { return begin(sample, std::move(passed)); });
  const bool solved = timed(stages.cut, [&] { return cut_freely(sample, taken.has_value(), result); });
  blade.arrive(sample);
  if (is_loaded(sample, result)) {
    if (state.model.body == nullptr)
      timed(stages.body, [&] { updater.build(state.model); });
    if (!solved)
      timed(stages.solve, [&] { contact.solve(sample, state.model); });
    if (state.touch)
      timed(stages.body, [&] { follow_tool(sample, result); });
    if (resisted)
      timed(stages.cut, [&] { loading.cut_surface = resisted->press(sample, *result.cut); });
    if (tears)
      timed(stages.tear, [&] { tears->tear(sample, loading, result); });
    timed(stages.force, [&] { report.tell_linear(resisted.get(), result); });
  } else if (resisted && sample.blade) { // it is outside: from here on its way goes into the tissue
    timed(stages.cut, [&] { resisted->press(sample, *result.cut); });
  }
  result.resprinkled = tool.has_taken() || result.resprinkled;
  result.rebuild = std::exchange(state.rebuild, Rebuild::none);
}

void Session::Parts::step_finite(const StepSample& sample, std::vector<topology::BladePose> passed,
                                 StepResult& result) {
  Loading loading;
  look_without_blade();
  {
    const StageTimer timer(result.stages.solve);
    loading.releases = follow_grip(sample, state, grasping);
  }
  const std::optional<CutReport> taken = cutting.take_report();
  bool is_solved = false;
  if (has_cuts(state.scenario)) {
    const StageTimer timer(result.stages.cut);
    result.cut = taken.value_or(CutReport{});
    blade.begin_step(sample, std::move(passed), state.zone.fine());
    is_solved = cut_freely(sample, taken.has_value(), result);
    blade.arrive(sample);
  }
  {
    const StageTimer timer(result.stages.solve);
    is_solved = finite.solve(sample, is_solved, resisted && resisted->enters(sample));
  }
  if (is_solved && may_follow_finite()) {
    const StageTimer timer(result.stages.body);
    follow_tool(sample, result);
  }
  if (resisted && (is_solved || sample.blade)) {
    const StageTimer timer(result.stages.cut);
    loading.cut_surface = resisted->press(sample, *result.cut);
  }
  if (is_solved && tears) {
    const StageTimer timer(result.stages.tear);
    tears->tear(sample, loading, result);
  }
  if (is_solved)
    report.tell_finite(resisted.get(), result);
  result.resprinkled = tool.has_taken() || result.resprinkled;
  result.rebuild = std::exchange(state.rebuild, Rebuild::none);
}

// Where a path leads the tool, nodes are fine all along it. What has faded of a viscoelastic body is known at the
// points of its quadrature, and those of other nodes are elsewhere.
bool Session::Parts::may_follow_finite() {
  if (state.leader == Leader::path || !state.touch)
    return false;
  if (state.scenario.law.spec.prony.empty())
    return true;
  const topology::SurfaceContact& contact = *state.contact;
  if (contact.depth > 0 && state.zone.is_left_by(contact))
    state.log.warn("faded zone", "the tool has left the place where nodes are fine: with material.prony they do not "
                                 "follow it, and its force is that of coarse nodes");
  return false;
}

topology::SurfaceContact Session::Parts::find_contact(const topology::ToolPose& pose) const {
  const topology::ToolShape& shape = state.scenario.tool->shape;
  return state.contact && !state.scenario.tool->grasp ? state.query.walk(shape, pose, *state.contact)
                                                      : state.query.first_touch(shape, pose);
}

// The solution is again that which the next step goes on from.
void Session::Parts::look_without_blade() {
  if (state.model.without_blade)
    state.model.field = *std::exchange(state.model.without_blade, std::nullopt);
  if (state.model.finite != nullptr)
    state.model.finite->show_pressed(false);
}

// What the last step has left, the grasper, and where the blade is. True: the grasper has let go.
bool Session::Parts::begin(const StepSample& sample, std::vector<topology::BladePose> passed) {
  contact.begin_step();
  look_without_blade();
  if (sample.blade && !background.follows_cut())
    background.drop_following();
  const bool released = grasp(sample);
  blade.begin_step(sample, std::move(passed), state.zone.fine());
  return released;
}

// Takes hold or lets go where its time has come; the body is then condensed onto the patch anew. True: it has let go.
bool Session::Parts::grasp(const StepSample& sample) {
  switch (grasping.change_at(sample, state.options.grip)) {
  case Grasping::Change::none:
    return false;
  case Grasping::Change::closes:
    if (take_hold(sample))
      contact.solve(sample, state.model);
    return false;
  case Grasping::Change::opens:
    break;
  }
  grasping.let_go();
  if (state.model.body == nullptr)
    return false;
  contact.condense({}, state.model);
  contact.solve(sample, state.model);
  return true;
}

// The body is condensed onto what the grasper then holds. False: that is nothing, it is off the surface.
bool Session::Parts::take_hold(const StepSample& sample) {
  BodyModel& model = state.model;
  if (model.body == nullptr)
    updater.build(model);
  if (!model.state)
    solve_contact(nullptr, nullptr, state.scenario, model);
  Vector3 at_rest = sample.tool->point;
  try {
    at_rest = state.rest_of(at_rest);
  } catch (const NumericalError&) { // in front of the surface
  }
  Grasp grasp = grasping.reach_for(at_rest, *sample.tool, model, state.zone.fine());
  if (const std::optional<std::string> miss = grasping.miss(grasp, sample, model)) { // led by a hand
    state.log.warn("grip", *miss);
    return false;
  }
  const std::vector<int> nodes = grasping.nodes_between(grasp, model, state.zone.fine());
  const solvers::Field before = model.field;
  contact.condense(nodes, model);
  const MatrixX moved = model.body->contact_displacements(nodes, {before});
  for (std::size_t c = 0; c < nodes.size(); ++c) {
    grasp.rest.push_back(model.patch.rest[c]);
    grasp.displacement.emplace_back(moved.col(0).segment<3>(3 * static_cast<Eigen::Index>(c)));
  }
  grasping.take(std::move(grasp));
  return true;
}

// A blade that nothing resists cuts before the step is solved. `another_body` has taken over since the last step. True:
// it is solved already.
bool Session::Parts::cut_freely(const StepSample& sample, bool another_body, StepResult& result) {
  if (state.incisions == nullptr || resisted)
    return false;
  bool solved = false;
  if (state.model.built() && !state.model.solved() && (sample.blade || another_body)) { // by its field a blade is
    contact.solve(sample, state.model);                                                 // carried to the tissue at
    solved = true;                                                                      // rest
  }
  return cutting.move(sample, *result.cut) || solved;
}

// Without any load the organ keeps its rest shape until the tool is on it.
bool Session::Parts::is_loaded(const StepSample& sample, const StepResult& result) const {
  const bool touched = state.touch && (has_grasper(state.scenario) ? grasping.holds() : result.contact.depth > 0);
  return has_loads(state.scenario) || ((state.touch || has_cuts(state.scenario)) &&
                                       (touched || state.model.body != nullptr || state.model.incision != nullptr ||
                                        (resisted && resisted->enters(sample))));
}

// Fine nodes go along with the tool.
void Session::Parts::follow_tool(const StepSample& sample, StepResult& result) {
  const topology::SurfaceContact centre = state.zone.centre_of(result.contact, result.pose);
  const bool waits =
      background.follows_cut() && !state.zone.is_left_by(centre); // nodes are made at one place at a time
  if (!state.zone.must_follow(centre) || waits)
    return;
  if (state.options.following_in_background && !sample.blade && !background.follows_cut()) {
    tool.follow_in_background(sample, centre);
    return;
  }
  if (background.follows_cut())
    cutting.wait_for(sample, *result.cut);
  tool.follow(sample, centre, result);
  if (resisted && result.resprinkled)
    resisted->withdraw();
}

void Session::prepare(const StepSample& sample) {
  Parts& of = *parts_;
  BodyModel& model = of.state.model;
  if (is_nonlinear(of.state.scenario.law)) {
    if (computes() && model.finite == nullptr)
      make_finite(of.state, model);
    if (of.state.touch && of.state.leader == Leader::device && !has_grasper(of.state.scenario))
      model.finite->prepare_to_condense(of.contact.candidates(model));
    return;
  }
  if (!computes() || (model.body != nullptr && !std::exchange(of.has_hung, false)))
    return;
  if (sample.tool)
    of.state.contact = of.find_contact(*sample.tool);
  if (model.body == nullptr)
    of.updater.build(model);
  if (of.state.touch && !of.state.scenario.tool->grasp && model.patch.nodes.empty())
    of.contact.condense(of.contact.candidates(model), model);
}

void Session::lift_blade() {
  if (!parts_->state.scenario.blade)
    return;
  parts_->blade.lift();
  if (parts_->resisted)
    parts_->resisted->lift();
}

void Session::set_options(const SessionOptions& options) {
  Parts& of = *parts_;
  of.state.options = options;
  if (options.following_in_background)
    return;
  if (of.background.follows_cut())
    of.cutting.take();
  if (of.background.proposing() != nullptr)
    of.resisted->drop_proposal();
  of.background.drop_following();
}

PendingBody Session::pending() const {
  const Parts& of = *parts_;
  const bool lags_in_background = of.resisted && of.resisted->lags_in_background();
  PendingBody pending;
  pending.under_way = of.background.is_under_way();
  pending.there = of.background.is_there();
  pending.put_off =
      (of.blade.put_off() > 0 && of.policy() == CutPolicy::in_background && !of.background.follows_cut()) ||
      (lags_in_background && of.background.proposing() == nullptr);
  pending.lags = of.blade.put_off() > 0 || of.background.follows_cut() || lags_in_background;
  return pending;
}

bool Session::swap_body() {
  Parts& of = *parts_;
  if (of.state.model.finite != nullptr)
    of.look_without_blade();
  if (of.background.follows_cut())
    return of.cutting.take();
  if (of.background.is_following()) {
    of.tool.take();
    return true;
  }
  if (of.background.proposing() != nullptr) { // becomes the blade's once a step has solved it
    of.background.let_arrive();
    return true;
  }
  return false;
}

void Session::coarsen(double factor) {
  parts_->state.zone.coarsen(factor);
}

const std::vector<StepSample>& Session::steps() const {
  return parts_->state.steps;
}

bool Session::touches() const {
  return parts_->state.touch.has_value();
}

bool Session::computes() const {
  return touches() || has_cuts(scenario()) || has_loads(scenario());
}

bool Session::grasps() const {
  return parts_->grasping.holds();
}

const std::optional<topology::BladePose>& Session::last_blade() const {
  return parts_->blade.last();
}

const SessionOptions& Session::options() const {
  return parts_->state.options;
}

const Scenario& Session::scenario() const {
  return parts_->state.scenario;
}

const Organ& Session::organ() const {
  return parts_->state.organ;
}

const OrganWalls& Session::walls() const {
  return parts_->state.zone.walls();
}

const FineZone& Session::zone() const {
  return parts_->state.zone.zone();
}

const BodyModel& Session::model() const {
  return parts_->state.model;
}

const BladeForce* Session::blade() const {
  return parts_->resisted ? &parts_->resisted->force() : nullptr;
}

const topology::Wound* Session::wound() const {
  return parts_->state.wound();
}

const std::vector<solvers::PointState>& Session::node_states() const {
  return parts_->state.node_states;
}

const SessionProfile& Session::profile() const {
  return parts_->state.profile;
}

const std::vector<std::string>& Session::warnings() const {
  return parts_->state.log.warnings();
}

} // namespace spherecut::app
