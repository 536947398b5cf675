#include "src/haptics/simulation.hpp"

#include "src/haptics/haptic_tick.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace spherecut::app {

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

HapticSimulation::HapticSimulation(Scenario scenario, std::function<void(const std::string&)> say)
    : session_(std::move(scenario), std::move(say)) {
  session_.set_force_only(true);
  static_cast<void>(path());
}

const topology::ToolShape& HapticSimulation::tool() const {
  static const topology::ToolShape none = topology::SphereTip{};
  return session_.scenario().tool ? session_.scenario().tool->shape : none;
}

StepSample HapticSimulation::sample(const DeviceState& device) const {
  const Scenario& scenario = session_.scenario();
  StepSample sample{device.time, std::nullopt, std::nullopt};
  if (scenario.tool) {
    sample.tool = tool_pose(scenario.tool->shape, device);
    if (scenario.blade)
      sample.blade = blade_pose(*scenario.blade, device.time);
  } else {
    sample.blade = topology::BladePose{device.time, device.position, device.orientation};
  }
  return sample;
}

void HapticSimulation::prepare(const DeviceState& device) {
  session_.prepare(sample(device));
}

void HapticSimulation::solve(const DeviceState& device, int degradation, ContactSnapshot& snapshot) {
  const auto start = std::chrono::steady_clock::now();
  if (degradation != degradation_) {
    session_.coarsen(std::pow(coarse_per_level, degradation));
    degradation_ = degradation;
  }
  result_ = session_.step(sample(device));
  const BodyModel& model = session_.model();
  if (model.patch.nodes.empty() || !model.state) {
    clear(snapshot);
    snapshot.pose = result_.pose;
    snapshot.contact = result_.contact;
  } else {
    const bool lips = model.lips && std::any_of(model.state->lips.closed.begin(), model.state->lips.closed.end(),
                                                [](char closed) { return closed != 0; });
    const solvers::ContactCondition condition = session_.scenario().contact.condition;
    if (lips)
      fill(solvers::held_patch(model.patch, *model.lips, model.state->lips.closed), model.state->tool, result_.contact,
           condition, snapshot);
    else
      fill(model.patch, model.state->tool, result_.contact, condition, snapshot);
  }
  snapshot.pose_tick = device.tick;
  snapshot.time = device.time;
  snapshot.resprinkled = result_.resprinkled;
  snapshot.cut_triangles = result_.cut ? result_.cut->triangles : 0;
  snapshot.degradation = degradation_;
  snapshot.nodes = result_.nodes;
  snapshot.solve_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

} // namespace spherecut::app
