#include "src/live/simulation.hpp"

#include "src/haptics/tick.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double pass_distance = 0.1; // fine spacings between poses that the blade passes
constexpr int longest_unheard = 20; // ticks without a pose, after which a hand may come in one tick as far as in those

// FNV-1a over words: equal bits, equal hash.
class Hash {
 public:
  void add(std::uint64_t word) {
    for (int byte = 0; byte < 8; ++byte)
      value_ = (value_ ^ ((word >> (8 * byte)) & 0xff)) * 0x100000001b3U;
  }
  void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

std::uint64_t topology_of(const Session& session, const StepResult& result) {
  Hash hash;
  for (const Vector3& x : session.model().sprinkling.nodes.positions)
    for (int axis = 0; axis < 3; ++axis)
      hash.add(x[axis]);
  if (result.cut) {
    hash.add(result.cut->area);
    hash.add(result.cut->surface_hash);
    hash.add(static_cast<std::uint64_t>(result.cut->closed_pairs));
  }
  return hash.value();
}

} // namespace

void DegradationRule::rebuilt(double seconds) {
  if (seconds > budget_) {
    level_ = std::min(level_ + 1, most_degradation);
    quick_ = 0;
  } else if (seconds > budget_ / 3) {
    quick_ = 0;
  } else if (++quick_ == 8) {
    level_ = std::max(level_ - 1, 0);
    quick_ = 0;
  }
}

void DegradationRule::solved(Rebuild rebuild, double seconds) {
  if (rebuild == Rebuild::in_step)
    rebuilt(seconds);
  else if (rebuild == Rebuild::in_background_early)
    rebuilt(0);
  else if (rebuild == Rebuild::in_background)
    rebuilt(budget_ / 2);
}

HapticSimulation::HapticSimulation(Scenario scenario, std::function<void(const std::string&)> say)
    : session_(std::move(scenario), std::move(say), Leader::device) {
  session_.set_options({.force_only = true, .going_on = true, .tear_gradually = true});
  static_cast<void>(path());
  parked_ = parked_tool();
}

const topology::ToolShape& HapticSimulation::tool() const {
  static const topology::ToolShape none = topology::SphereTip{};
  return session_.scenario().tool ? session_.scenario().tool->shape : none;
}

StepSample HapticSimulation::sample(const Hands& hands) const {
  const Scenario& scenario = session_.scenario();
  const DeviceState& device = hands.first;
  StepSample sample{device.time, std::nullopt, std::nullopt};
  const auto mode = static_cast<HandMode>(device.mode);
  const auto blade_of = [&](const DeviceState& hand) {
    return topology::BladePose{device.time, hand.position, hand.orientation};
  };
  if (mode == HandMode::blade) {
    sample.tool = parked_;
    if (scenario.blade)
      sample.blade = blade_of(device);
  } else if (scenario.tool) {
    sample.tool = tool_pose(scenario.tool->shape, device);
    if (hands.second && scenario.blade) {
      sample.blade = blade_of(*hands.second);
    } else if (mode == HandMode::usual && scenario.blade && !hands.are_two) {
      double time = device.time;
      if (const double end = scenario.blade->path.back().time; solved_before(end)) // to there, whenever it is solved
        time = std::min(time, end);
      sample.blade = blade_pose(*scenario.blade, time);
    }
  } else if (mode == HandMode::usual) {
    sample.blade = blade_of(device);
  }
  return sample;
}

void HapticSimulation::require_two_hands() const {
  const Scenario& scenario = session_.scenario();
  if (!scenario.tool || !scenario.blade)
    throw InputError(fmt::format("{}: a second hand, but no {}; allowed: with [tool] and [blade]",
                                 scenario.file.string(), scenario.tool ? "[blade]" : "[tool]"));
}

bool HapticSimulation::holds_blade() const {
  return mode_ == HandMode::blade || (mode_ == HandMode::usual && !session_.scenario().tool);
}

std::optional<topology::ToolPose> HapticSimulation::parked_tool() const {
  const Scenario& scenario = session_.scenario();
  if (!scenario.tool)
    return std::nullopt;
  topology::ToolPose pose = *session_.steps().front().tool;
  double away = 0.5 * session_.organ().domain->bounds().extent().norm();
  if (const auto* instrument = std::get_if<topology::Laparoscope>(&scenario.tool->shape))
    away = std::min(away, 0.5 * (instrument->port - pose.point).norm());
  pose.point += away * pose.axis;
  return pose;
}

void HapticSimulation::set_following_in_background(bool on) {
  SessionOptions options = session_.options();
  options.following_in_background = on;
  session_.set_options(options);
}

void HapticSimulation::prepare(const Hands& hands) {
  session_.prepare(sample(hands));
}

HapticSimulation::Holder HapticSimulation::holder(const Hands& hands) const {
  const Scenario& scenario = session_.scenario();
  const auto mode = static_cast<HandMode>(hands.first.mode);
  if (!scenario.blade)
    return Holder::nobody;
  if (mode == HandMode::blade || (mode == HandMode::usual && !scenario.tool))
    return Holder::first;
  if (hands.second)
    return Holder::second;
  return mode == HandMode::usual && !hands.are_two ? Holder::path : Holder::nobody;
}

// Every tick, in order: whether the blade has been let go of, or put elsewhere. A hand that has not moved for some
// ticks may have gone on unheard meanwhile.
void HapticSimulation::watch_blade(const Hands& hands) {
  const Holder now = holder(hands);
  const bool is_held = now == Holder::first || now == Holder::second;
  const DeviceState& hand = now == Holder::second ? *hands.second : hands.first;
  const double way = (hand.position - held_.position).norm();                      // m, since the tick before
  const double furthest = fastest_hand * (hand.time - held_.time) * (1 + rested_); // m
  const bool goes_on = now == holder_ && hand.tick == held_.tick + 1;
  if (last_time_ && (now != holder_ || (is_held && (!hand.connected || (goes_on && way > furthest))))) {
    let_go_ = true;
    passed_.clear();
  }
  rested_ = goes_on && way == 0 ? std::min(rested_ + 1, longest_unheard) : 0;
  holder_ = now;
  held_ = hand;
}

void HapticSimulation::pass(const Hands& hands) {
  const DeviceState& device = hands.first;
  if (!last_time_ || device.tick <= last_tick_)
    return;
  watch_blade(hands);
  if (!session_.scenario().blade || let_go_ || static_cast<HandMode>(device.mode) != mode_ ||
      !held_.position.allFinite() || !held_.orientation.coeffs().allFinite())
    return;
  const std::optional<topology::BladePose> pose = sample(hands).blade;
  const std::optional<topology::BladePose> last = passed_.empty() ? session_.last_blade() : passed_.back();
  if (pose && last && pose->time > last->time &&
      edge_travel(session_.scenario().blade->edge, *last, *pose) > pass_distance * session_.zone().spacing.fine)
    passed_.push_back(*pose);
}

void HapticSimulation::solve(const Hands& hands, int degradation, ContactSnapshot& snapshot, ContactSnapshot* second) {
  const auto start = std::chrono::steady_clock::now();
  const DeviceState& device = hands.first;
  watch_blade(hands);
  std::vector<topology::BladePose> passed = std::exchange(passed_, {});
  last_tick_ = device.tick;
  if (degradation != degradation_) {
    session_.coarsen(std::pow(coarse_per_level, degradation));
    degradation_ = degradation;
  }
  mode_ = static_cast<HandMode>(device.mode);
  if (std::exchange(let_go_, false)) {
    session_.lift_blade();
    passed.clear();
  }
  if (mode_ != HandMode::usual) {
    SessionOptions options = session_.options();
    options.grip = mode_ == HandMode::grasper && (device.buttons & 1U) != 0;
    session_.set_options(options);
  }
  result_ = session_.step(sample(hands), std::move(passed));
  last_time_ = device.time;
  fill_tool(snapshot);
  if (holds_blade())
    fill_blade(device, snapshot);
  fill_common(device, snapshot);
  if (second != nullptr) {
    const DeviceState other = hands.second ? with_blade(*hands.second) : idle_hand(device);
    if (hands.second)
      fill_blade(other, *second);
    else
      clear(*second);
    fill_common(other, *second);
  }
  snapshot.solve_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// What presses or grasps, as if the first hand held it.
void HapticSimulation::fill_tool(ContactSnapshot& snapshot) {
  const BodyModel& model = session_.model();
  snapshot.friction = session_.scenario().contact.friction;
  const solvers::ContactCondition condition =
      session_.grasps() ? solvers::ContactCondition::bonded : session_.scenario().contact.condition;
  if (model.patch.nodes.empty() || !model.state) {
    clear(snapshot);
    snapshot.pose = result_.pose;
    snapshot.contact = result_.contact;
    snapshot.condition = condition;
    return;
  }
  const bool lips = model.lips && std::any_of(model.state->lips.closed.begin(), model.state->lips.closed.end(),
                                              [](char closed) { return closed != 0; });
  if (lips)
    fill(solvers::held_patch(model.patch, *model.lips, model.state->lips.closed), model.state->tool, result_.contact,
         condition, condensed_, snapshot);
  else
    fill(model.patch, model.state->tool, result_.contact, condition, condensed_, snapshot);
  condensed_ = snapshot.condensed;
  if (session_.grasps()) { // its force is held until the next solve: that with the blade beside it
    snapshot.force = result_.force;
    snapshot.torque = result_.torque;
  }
}

// The blade in the hand.
void HapticSimulation::fill_blade(const DeviceState& device, ContactSnapshot& snapshot) const {
  clear(snapshot);
  snapshot.pose.point = device.position;
  snapshot.orientation = device.orientation;
  if (session_.blade() == nullptr)
    return;
  snapshot.blade = session_.blade()->grip(session_.model());
  snapshot.force = snapshot.blade.force;
  snapshot.torque = snapshot.blade.torque;
}

void HapticSimulation::fill_common(const DeviceState& device, ContactSnapshot& snapshot) const {
  snapshot.pose_tick = device.tick;
  snapshot.mode = device.mode;
  snapshot.without_tool = !session_.scenario().tool;
  snapshot.time = device.time;
  snapshot.resprinkled = result_.resprinkled;
  snapshot.cut_triangles = result_.cut ? result_.cut->triangles : 0;
  snapshot.degradation = degradation_;
  snapshot.nodes = result_.nodes;
  snapshot.topology = topology_of(session_, result_);
}

SolveRecord solve_recording(HapticSimulation& simulation, const Hands& hands, const SolveEvent& event,
                            ContactSnapshot& snapshot, ContactSnapshot* second) {
  const auto failed = [&](const std::exception& error) {
    SolveRecord record;
    record.event = event;
    record.failed = true;
    record.reason = error.what();
    return record;
  };
  try {
    simulation.set_following_in_background(event.in_background);
    if (event.swaps)
      simulation.swap_body();
    simulation.solve(hands, event.degradation, snapshot, second);
  } catch (const NumericalError& error) {
    return failed(error);
  } catch (const InputError& error) { // of the pose: the contact has reached a fixed region
    return failed(error);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) { // no thread, no memory: the loop goes on with the snapshot it has
    return failed(error);
  }
  snapshot.sequence = event.sequence;
  if (second != nullptr)
    second->sequence = event.sequence;
  SolveRecord record = record_of(event, snapshot);
  record.force_jump = simulation.result().force_jump;
  if (const auto& cut = simulation.result().cut) {
    record.cut_area = cut->area;
    record.residual = simulation.result().residual;
    record.update = to_string(simulation.result().update());
    record.blade_force = cut->blade.force;
    record.blade_torque = cut->blade.torque;
    record.blade_edge = cut->blade.edge_force;
    record.blade_release = cut->blade.release;
    record.blade_contacts = cut->blade.contacts;
    record.blade_account = cut->blade.ledger;
  }
  return record;
}

} // namespace spherecut::app
