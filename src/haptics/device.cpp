#include "src/haptics/device.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr int substeps = 10; // of the hand's motion in a tick

void check_path(const std::vector<PathPose>& path, double rate) {
  if (path.empty())
    throw InputError("the path of a device has no pose; allowed: one or more");
  for (std::size_t i = 1; i < path.size(); ++i)
    if (!(path[i].time > path[i - 1].time))
      throw InputError(fmt::format("pose {} of a device's path, at {:g} s, is not after the one before it at {:g} s",
                                   i + 1, path[i].time, path[i - 1].time));
  if (!(rate > 0) || !std::isfinite(rate))
    throw InputError(fmt::format("a haptic rate of {:g} ticks per second; allowed: above 0", rate));
}

DeviceState state_of(const PathPose& pose, std::uint64_t tick) {
  return {tick, pose.time, pose.position, pose.orientation, true};
}

/// Two poses of a path and how far a time is from the one to the other.
struct Leg {
  const PathPose& from;
  const PathPose& to;
  double share;
  [[nodiscard]] Vector3 position() const noexcept { return from.position + share * (to.position - from.position); }
};

/// `low`: number of the pose from which the leg is looked for, and where it starts.
Leg leg_at(const std::vector<PathPose>& path, double time, std::size_t& low) noexcept {
  if (time <= path.front().time || path.size() == 1)
    return {path.front(), path.front(), 0};
  if (time >= path.back().time)
    return {path.back(), path.back(), 0};
  if (!(path[low].time <= time && time < path[low + 1].time)) {
    low = 0;
    std::size_t high = path.size() - 1; // path[low].time <= time < path[high].time
    while (high - low > 1) {
      const std::size_t middle = (low + high) / 2;
      (path[middle].time <= time ? low : high) = middle;
    }
  }
  const PathPose& from = path[low];
  const PathPose& to = path[low + 1];
  return {from, to, (time - from.time) / (to.time - from.time)};
}

} // namespace

std::string_view device_name(HeldDevice device) {
  switch (device) {
  case HeldDevice::script:
    return "script";
  case HeldDevice::hand:
    return "hand";
  case HeldDevice::recording:
    return "recording";
  case HeldDevice::bridge:
    return "bridge";
  case HeldDevice::haply:
    return "haply";
  }
  return "unknown";
}

Hands read_hands(Device& first, Device* second, std::uint64_t tick) noexcept {
  Hands hands(first.read(tick));
  if (second == nullptr)
    return hands;
  hands.are_two = true;
  const DeviceState other = second->read(tick);
  const auto mode = static_cast<HandMode>(other.mode);
  if ((mode == HandMode::usual || mode == HandMode::blade) &&
      hands.first.mode != static_cast<std::uint16_t>(HandMode::blade))
    hands.second = other;
  return hands;
}

DeviceState with_blade(DeviceState hand) noexcept {
  hand.mode = static_cast<std::uint16_t>(HandMode::blade);
  return hand;
}

DeviceState idle_hand(const DeviceState& other) noexcept {
  DeviceState idle;
  idle.tick = other.tick;
  idle.time = other.time;
  idle.connected = false;
  idle.mode = static_cast<std::uint16_t>(HandMode::probe);
  return idle;
}

PathPose path_pose(const std::vector<PathPose>& path, double time) noexcept {
  std::size_t low = 0;
  const Leg leg = leg_at(path, time, low);
  // A turn takes a sine and its inverse, and few poses turn.
  const bool turns = leg.from.orientation.coeffs() != leg.to.orientation.coeffs();
  return {time, leg.position(),
          turns ? leg.from.orientation.slerp(leg.share, leg.to.orientation) : leg.from.orientation};
}

std::vector<PathPose> driven_path(const std::vector<StepSample>& steps) {
  std::vector<PathPose> path;
  for (const StepSample& sample : steps)
    if (sample.tool)
      path.push_back(
          {sample.time, sample.tool->point, Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), sample.tool->axis)});
  if (!path.empty())
    return path;
  if (std::none_of(steps.begin(), steps.end(), [](const StepSample& sample) { return sample.blade.has_value(); }))
    throw InputError("there is neither tool nor blade for a device to hold");
  return blade_path(steps);
}

std::vector<PathPose> blade_path(const std::vector<StepSample>& steps) {
  std::vector<PathPose> path;
  for (const StepSample& sample : steps)
    if (sample.blade)
      path.push_back({sample.time, sample.blade->position, sample.blade->orientation});
  if (path.empty())
    throw InputError("there is no blade for a second device to hold");
  return path;
}

ScriptedPath::ScriptedPath(std::vector<PathPose> path, double rate) : path_(std::move(path)), rate_(rate) {
  check_path(path_, rate_);
}

DeviceState ScriptedPath::read(std::uint64_t tick) noexcept {
  return state_of(path_pose(path_, static_cast<double>(tick) / rate_), tick);
}

SimulatedHand::SimulatedHand(std::vector<PathPose> path, const HandSettings& settings, double rate)
    : path_(std::move(path)), settings_(settings), rate_(rate) {
  check_path(path_, rate_);
  if (!(settings.mass > 0) || !(settings.stiffness >= 0) || !(settings.damping >= 0) || !(settings.resolution >= 0))
    throw InputError(
        fmt::format("a hand of {:g} kg, {:g} N/m, {:g} N s/m and a sensor of {:g} m; allowed: a mass above "
                    "0, the others 0 or more",
                    settings.mass, settings.stiffness, settings.damping, settings.resolution));
  if (settings.delay < 0 || settings.delay > longest_delay)
    throw InputError(fmt::format("a force {} ticks late; allowed: 0 to {}", settings.delay, longest_delay));
  forces_.fill(Vector3::Zero());
}

DeviceState SimulatedHand::read(std::uint64_t tick) noexcept {
  const double now = static_cast<double>(tick) / rate_;
  if (!started_) {
    position_ = leg_at(path_, settings_.rides_path ? now : path_.front().time, leg_).position();
    started_ = true;
  } else {
    const double step = 1 / (rate_ * substeps);
    const Vector3 force = forces_[static_cast<std::size_t>(settings_.delay)];
    for (int i = 0; i < substeps; ++i) {
      Vector3 target = path_.front().position;
      Vector3 target_velocity = Vector3::Zero();
      if (settings_.rides_path) {
        const double t = now - 1 / rate_ + (i + 1) * step;
        target = leg_at(path_, t, leg_).position();
        target_velocity = (target - leg_at(path_, t - step, leg_).position()) / step;
      }
      const Vector3 pull =
          settings_.stiffness * (target - position_) + settings_.damping * (target_velocity - velocity_) + force;
      velocity_ += step / settings_.mass * pull;
      work_ -= step * force.dot(velocity_);
      position_ += step * velocity_;
    }
  }
  DeviceState state = state_of(path_pose(path_, now), tick);
  state.position = position_;
  if (settings_.resolution > 0)
    for (int axis = 0; axis < 3; ++axis)
      state.position[axis] = settings_.resolution * std::round(position_[axis] / settings_.resolution);
  return state;
}

void SimulatedHand::apply(const Vector3& force) noexcept {
  for (std::size_t i = forces_.size() - 1; i > 0; --i)
    forces_[i] = forces_[i - 1];
  forces_[0] = force;
}

} // namespace spherecut::app
