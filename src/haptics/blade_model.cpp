#include "src/haptics/blade_model.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::app {
namespace {

constexpr double drag_travel = 5e-4; // m, of motion back over which the drag of the flanks turns over

/// Rotation vector of the shorter way from one orientation to another.
Vector3 turn_between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) noexcept {
  const Eigen::Quaterniond turn = to * from.conjugate();
  const double sine = turn.vec().norm();
  if (!(sine > 0))
    return Vector3::Zero();
  const double sign = turn.w() < 0 ? -1 : 1;
  return sign * 2 * std::atan2(sine, sign * turn.w()) / sine * turn.vec();
}

} // namespace

bool BladeModel::solved(const ContactSnapshot& snapshot) noexcept {
  const bool was = pressing();
  grip_ = snapshot.blade;
  solved_at_ = snapshot.pose.point;
  solved_turn_ = snapshot.orientation;
  if (!was) {
    last_ = solved_at_;
    last_turn_ = solved_turn_;
    drag_ = 1;
    found_ = pressing();
  }
  return was || pressing();
}

ModelForce BladeModel::at(const Vector3& position, const Eigen::Quaterniond& orientation, double time) noexcept {
  ModelForce result;
  result.stored = 0;
  result.found = true;
  if (!pressing())
    return result;
  if (found_)
    entered_ = time;
  found_ = false;
  const double share = std::clamp((time - entered_) / onset, 0.0, 1.0);
  const double gone = (position - solved_at_).dot(grip_.along) + turn_between(solved_turn_, orientation).dot(grip_.arm);
  const double since = (position - last_).dot(grip_.along) + turn_between(last_turn_, orientation).dot(grip_.arm);
  drag_ = std::clamp(drag_ + 2 * since / drag_travel, -1.0, 1.0);
  last_ = position;
  last_turn_ = orientation;
  const double edge = std::clamp(grip_.edge + grip_.stiffness * gone, 0.0, grip_.due);
  result.force = share * (-edge * grip_.along + drag_ * grip_.drag);
  result.torque = share * (-edge * grip_.arm + drag_ * grip_.drag_torque);
  result.active = grip_.contacts;
  result.stiffness = edge > 0 && edge < grip_.due ? share * grip_.stiffness : 0;
  if (grip_.stiffness > 0)
    result.stored = std::max(0.0, grip_.stored + 0.5 * (edge * edge - grip_.edge * grip_.edge) / grip_.stiffness);
  else
    result.stored = grip_.stored;
  *result.stored *= share;
  return result;
}

} // namespace spherecut::app
