#include "src/haptics/force_model.hpp"

#include "src/haptics/tangent_model.hpp"

#include <algorithm>

namespace spherecut::app {
namespace {

class HoldModel : public ForceModel {
 public:
  bool solved(const ContactSnapshot& snapshot) noexcept override {
    force_ = snapshot.force;
    torque_ = snapshot.torque;
    return false;
  }
  ModelForce at(const topology::ToolPose& /*pose*/, const Eigen::Quaterniond& /*orientation*/,
                double /*time*/) noexcept override {
    ModelForce result;
    result.force = force_;
    result.torque = torque_;
    return result;
  }

 private:
  Vector3 force_ = Vector3::Zero(), torque_ = Vector3::Zero();
};

/// Goes on along the line for three intervals between solves at most, so that a solve that does not come does not drive
/// the force away.
class LinearInTimeModel : public ForceModel {
 public:
  bool solved(const ContactSnapshot& snapshot) noexcept override {
    const double interval = snapshot.time - time_;
    const bool goes_on = solves_ > 0 && interval > 0;
    slope_ = goes_on ? Vector3((snapshot.force - force_) / interval) : Vector3(Vector3::Zero());
    torque_slope_ = goes_on ? Vector3((snapshot.torque - torque_) / interval) : Vector3(Vector3::Zero());
    longest_ = 3 * interval;
    force_ = snapshot.force;
    torque_ = snapshot.torque;
    time_ = snapshot.time;
    ++solves_;
    return false;
  }
  ModelForce at(const topology::ToolPose& /*pose*/, const Eigen::Quaterniond& /*orientation*/,
                double time) noexcept override {
    ModelForce result;
    const double since = std::clamp(time - time_, 0.0, longest_);
    result.force = force_ + since * slope_;
    result.torque = torque_ + since * torque_slope_;
    return result;
  }

 private:
  Vector3 force_ = Vector3::Zero(), slope_ = Vector3::Zero();
  Vector3 torque_ = Vector3::Zero(), torque_slope_ = Vector3::Zero();
  double time_ = 0, longest_ = 0;
  long solves_ = 0;
};

} // namespace

std::unique_ptr<ForceModel> make_force_model(ForceModelKind kind, const topology::ToolShape& tool) {
  switch (kind) {
  case ForceModelKind::hold:
    return std::make_unique<HoldModel>();
  case ForceModelKind::linear_in_time:
    return std::make_unique<LinearInTimeModel>();
  case ForceModelKind::tangent:
    break;
  }
  return std::make_unique<TangentModel>(tool);
}

} // namespace spherecut::app
