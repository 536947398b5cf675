#include "src/haptics/passivity.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double reserve = 2e-5;   // J, surplus that is kept
constexpr double make_up = 0.003;  // s, in which a deficit is made up
constexpr double smoothing = 0.08; // of the way to the wanted damping in a tick

} // namespace

PassivityControl::PassivityControl(const DeviceLimits& limits, double rate, bool active)
    : limits_(limits), rate_(rate), active_(active) {
  positions_.fill(Vector3::Zero());
  sent_.fill(Vector3::Zero());
  damping_forces_.fill(Vector3::Zero());
  if (limits.delay < 0 || limits.delay > static_cast<int>(longest_delay))
    throw InputError(fmt::format("a device that is {} ticks late; allowed: 0 to {}", limits.delay, longest_delay));
}

void PassivityControl::sent(const Vector3& force) noexcept {
  std::copy_backward(sent_.begin(), sent_.end() - 1, sent_.end());
  sent_[0] = force;
}

void PassivityControl::place() noexcept {
  placed_ = true;
  surplus_ = 0;
  damping_ = 0;
  finds_ = true;
}

double PassivityControl::sampling_allowance() const {
  return std::sqrt(3.0) * limits_.force * limits_.resolution;
}

Vector3 PassivityControl::velocity() const noexcept {
  const double tolerance = limits_.resolution * (1 + 1e-9);
  std::size_t length = 1; // ticks
  for (bool straight = true; straight && length + 1 < window;) {
    const std::size_t longer = length + 1;
    const Vector3 slope = (positions_[longer] - positions_[0]) / static_cast<double>(longer);
    for (std::size_t i = 1; i < longer && straight; ++i)
      straight =
          (positions_[0] + static_cast<double>(i) * slope - positions_[i]).lpNorm<Eigen::Infinity>() <= tolerance;
    if (straight)
      length = longer;
  }
  // Least squares over the ticks 0 to length back.
  const auto n = static_cast<double>(length);
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i <= length; ++i)
    sum += (0.5 * n - static_cast<double>(i)) * positions_[i];
  return 12 * rate_ / (n * (n + 1) * (n + 2)) * sum;
}

Vector3 PassivityControl::control(const Vector3& position, const Vector3& wanted,
                                  std::optional<double> stored) noexcept {
  const double now = stored.value_or(0);
  if (std::exchange(placed_, false))
    positions_.fill(position);
  if (std::exchange(finds_, false))
    stored_ = now;
  const Vector3 step = position - positions_[0];
  std::copy_backward(positions_.begin(), positions_.end() - 1, positions_.end());
  positions_[0] = position;
  const auto late = static_cast<std::size_t>(limits_.delay);
  const double gained = -sent_[late].dot(step);
  energy_ += gained;
  lowest_ = std::min(lowest_, energy_);
  damped_ -= damping_forces_[late].dot(step);
  std::copy_backward(damping_forces_.begin(), damping_forces_.end() - 1, damping_forces_.end());
  surplus_ = std::min(surplus_ + gained - (now - stored_), reserve);
  stored_ = now;
  damping_forces_[0].setZero();
  if (!active_)
    return wanted;
  const double deficit = -surplus_ - std::sqrt(3.0) * wanted.norm() * limits_.resolution;
  const Vector3 velocity = this->velocity();
  const double power = velocity.squaredNorm();
  const double needed = deficit > 0 && power > 0 ? std::min(deficit / (power * make_up), limits_.damping) : 0;
  damping_ += smoothing * (needed - damping_);
  damping_forces_[0] = -damping_ * velocity;
  return wanted + damping_forces_[0];
}

} // namespace spherecut::app
