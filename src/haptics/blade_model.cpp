#include "src/haptics/blade_model.hpp"

#include <algorithm>

namespace spherecut::app {
namespace {

constexpr double drag_travel = 5e-4; // m, of motion back over which the drag of the flanks turns over

} // namespace

bool BladeModel::solved(const ContactSnapshot& snapshot) noexcept {
  const bool was = pressing();
  grip_ = snapshot.blade;
  solved_at_ = snapshot.pose.point;
  if (!was) {
    last_ = solved_at_;
    drag_ = 1;
    found_ = pressing();
  }
  return was || pressing();
}

ModelForce BladeModel::at(const Vector3& position, double time) noexcept {
  ModelForce result;
  result.stored = 0;
  result.found = true;
  if (!pressing())
    return result;
  if (found_)
    entered_ = time;
  found_ = false;
  const double share = std::clamp((time - entered_) / onset, 0.0, 1.0);
  const double gone = (position - solved_at_).dot(grip_.along);
  drag_ = std::clamp(drag_ + 2 * (position - last_).dot(grip_.along) / drag_travel, -1.0, 1.0);
  last_ = position;
  const double edge = std::clamp(grip_.edge + grip_.stiffness * gone, 0.0, grip_.due);
  result.force = share * (-edge * grip_.along + drag_ * grip_.drag);
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
