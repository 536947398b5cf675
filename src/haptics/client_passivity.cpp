#include "src/haptics/client_passivity.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double kept_surplus = 2e-5; // J, surplus that is kept
constexpr double braked_below = 3e-5; // J
constexpr double braking = 1;         // N s/m, at most: more would swing by itself at the slowest rates
constexpr double faster = 1.25;       // the next step than the last, at most
constexpr int least_ticks = 6;        // over which the share changes
constexpr double velocity_smoothing = 0.05, brake_smoothing = 0.02; // of the way in a tick

} // namespace

ClientPassivity::ClientPassivity(const DeviceLimits& limits, double rate, bool active)
    : limits_(limits), rate_(rate), active_(active) {
  sent_.fill(Vector3::Zero());
}

void ClientPassivity::sent(const Vector3& force) noexcept {
  std::copy_backward(sent_.begin(), sent_.end() - 1, sent_.end());
  sent_[0] = force;
  sum_ += sent_[static_cast<std::size_t>(limits_.delay)];
  ++ticks_;
}

void ClientPassivity::place() noexcept {
  placed_ = true;
  finds_ = true;
  surplus_ = 0;
  share_ = target_ = 1;
  left_ = 0;
  brakes_ = false;
}

void ClientPassivity::take(const ClientReading& reading, const Vector3& position, const Vector3& wanted,
                           double stored) noexcept {
  const Vector3& now = sent_[static_cast<std::size_t>(limits_.delay)];
  const Vector3 step = reading.position - reading_;
  const Vector3 mean = ticks_ > 0 ? Vector3(sum_ / ticks_) : now;
  const double gained = std::min(-start_.dot(step), -mean.dot(step));
  energy_ += gained;
  lowest_ = std::min(lowest_, energy_);
  surplus_ = std::min(surplus_ + gained - (stored - stored_), kept_surplus);
  stored_ = stored;
  newest_velocity_ = ticks_ > 0 ? Vector3(rate_ / ticks_ * step) : Vector3(Vector3::Zero());
  reading_ = reading.position;
  start_ = now;
  sum_.setZero();
  ticks_ = 0;
  const double left = std::max(0.0, stored + surplus_ + energy_credit);
  // At the next reading the loop's tool will be where this one is.
  const double behind = std::max(stored, stored - wanted.dot(reading.position - position));
  target_ = behind > left ? std::sqrt(left / behind) : 1;
  if (const double next = faster * step.norm() * wanted.norm(); next > left)
    target_ = std::min(target_, left / next);
  left_ = std::max(least_ticks, static_cast<int>(std::lround(reading.period)));
  brakes_ = stored > 0 && left < braked_below;
}

Vector3 ClientPassivity::control(const ClientReading& reading, const Vector3& position, const Vector3& wanted,
                                 double stored) noexcept {
  if (std::exchange(finds_, false))
    stored_ = stored;
  if (std::exchange(placed_, false)) {
    reading_ = reading.position;
    start_ = sent_[static_cast<std::size_t>(limits_.delay)];
    sum_.setZero();
    ticks_ = 0;
    newest_velocity_.setZero();
    velocity_.setZero();
  } else if (reading.fresh) {
    take(reading, position, wanted, stored);
  }
  if (left_ > 0) {
    share_ += (target_ - share_) / left_;
    --left_;
  }
  velocity_ += velocity_smoothing * (newest_velocity_ - velocity_);
  brake_ += brake_smoothing * ((brakes_ ? 1 : 0) - brake_);
  if (!active_)
    return wanted;
  return share_ * wanted - brake_ * std::min(braking, limits_.damping) * velocity_;
}

} // namespace spherecut::app
