#include "src/devices/pointer_hand.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr int substeps = 10;           // of the tool's motion in a tick
constexpr double lag = 0.012;          // s, with which the hand follows its target
constexpr double step = 1e-6;          // m, in which the position is told: a hand at rest is at rest
constexpr double resting_angle = 1e-4; // radians, within which it is turned as wanted
constexpr double slack = 0.02;         // s, that the tool is loose for on a jump: the force has gone, the motion too
constexpr double turning = 12;         // radians a second at most

} // namespace

PointerHand::PointerHand(const HandSettings& settings, double rate, double speed, const PointerTarget& start)
    : settings_(settings), rate_(rate), speed_(speed), target_(start), hand_(start.position), position_(start.position),
      orientation_(start.orientation), mode_(start.mode), jumps_(start.jumps) {
  if (!(settings.mass > 0) || !(settings.stiffness > 0) || !(settings.damping >= 0) || !(rate > 0) || !(speed > 0))
    throw InputError(fmt::format("a pointer's hand of {:g} kg, {:g} N/m, {:g} N s/m at {:g} ticks per second and {:g} "
                                 "m/s; allowed: damping 0 or more, the others above 0",
                                 settings.mass, settings.stiffness, settings.damping, rate, speed));
}

void PointerHand::aim(const PointerTarget& target) noexcept {
  targets_.back() = target;
  targets_.publish();
}

DeviceState PointerHand::read(std::uint64_t tick) noexcept {
  if (targets_.fetch())
    target_ = targets_.front();
  if (loose_ == 0 && target_.jumps != jumps_)
    loose_ = 2 * std::max(1, static_cast<int>(slack * rate_));
  if (loose_ > 0) {
    // First without force where it is, then without force where it is wanted.
    --loose_;
    if (loose_ == static_cast<int>(slack * rate_))
      put_down();
  } else {
    move_hand();
    move_tip();
  }
  states_.back() = {tick, hand_, target_.number};
  states_.publish();
  numbers_[tick % remembered].store(target_.number, std::memory_order_relaxed);
  DeviceState state;
  state.tick = tick;
  state.time = static_cast<double>(tick) / rate_;
  for (int axis = 0; axis < 3; ++axis)
    state.position[axis] = step * std::round(position_[axis] / step);
  state.orientation = orientation_;
  state.connected = loose_ == 0;
  state.mode = static_cast<std::uint16_t>(mode_);
  state.buttons = target_.buttons;
  return state;
}

void PointerHand::put_down() noexcept {
  jumps_ = target_.jumps;
  mode_ = target_.mode;
  hand_ = position_ = target_.position;
  orientation_ = target_.orientation;
  velocity_.setZero();
  hand_velocity_.setZero();
  force_.setZero();
}

void PointerHand::move_hand() noexcept {
  Vector3 motion = (1 - std::exp(-1 / (lag * rate_))) * (target_.position - hand_);
  if (const double length = motion.norm(); length > speed_ / rate_)
    motion *= speed_ / (rate_ * length);
  hand_ += motion;
  hand_velocity_ = rate_ * motion;
  const double angle = orientation_.angularDistance(target_.orientation);
  if (angle <= resting_angle) {
    orientation_ = target_.orientation;
  } else {
    const double turn = std::min((1 - std::exp(-1 / (lag * rate_))) * angle, turning / rate_);
    orientation_ = orientation_.slerp(turn / angle, target_.orientation).normalized();
  }
}

void PointerHand::move_tip() noexcept {
  const double dt = 1 / (rate_ * substeps);
  for (int i = 0; i < substeps; ++i) {
    velocity_ +=
        dt / settings_.mass *
        (settings_.stiffness * (hand_ - position_) + settings_.damping * (hand_velocity_ - velocity_) + force_);
    position_ += dt * velocity_;
  }
}

} // namespace spherecut::app
