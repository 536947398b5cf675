#include "src/haptics/haptic_tick.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::app {
namespace {

constexpr double rim = 0.8; // of the candidates' reach: a contact beyond it takes the patch along

// A blade's force is that of the last solve, held: what it cuts next is not known before it is solved.
bool holds_force(const DeviceState& device) {
  return device.mode >= static_cast<std::uint16_t>(HandMode::blade);
}

} // namespace

topology::ToolPose tool_pose(const topology::ToolShape& tool, const DeviceState& device) noexcept {
  topology::ToolPose pose{device.position, device.orientation * Vector3::UnitZ()};
  if (const auto* instrument = std::get_if<topology::Laparoscope>(&tool)) {
    const Vector3 axis = instrument->port - device.position;
    if (const double length = axis.norm(); length > 0)
      pose.axis = axis / length;
  }
  return pose;
}

HapticTick::HapticTick(const HapticSettings& settings, const topology::ToolShape& tool,
                       const topology::ContactQuery* organ)
    : settings_(settings), tool_(tool), organ_(organ), model_(make_force_model(settings.model, tool)),
      passivity_(settings.limits, settings.rate, settings.passivity) {}

void HapticTick::start(const DeviceState& device) {
  if (organ_ != nullptr)
    contact_ = organ_->first_touch(tool_, tool_pose(tool_, device));
}

void HapticTick::locate(const DeviceState& device) noexcept {
  if (organ_ == nullptr || located_ == device.tick + 1 || holds_force(device))
    return;
  const topology::ToolPose pose = tool_pose(tool_, device);
  contact_ = organ_->walk(tool_, pose, contact_);
  // A tool that was put elsewhere leaves the walk behind; the solve has looked at the whole surface.
  if (fresh_ && snapshot_->mode == device.mode) {
    const topology::SurfaceContact there = organ_->walk(tool_, pose, snapshot_->contact);
    if (there.depth > contact_.depth)
      contact_ = there;
  }
  fresh_ = false;
  located_ = device.tick + 1;
}

ModelForce HapticTick::ask(const DeviceState& device, bool& outside) noexcept {
  outside = false;
  if (snapshot_ != nullptr && snapshot_->mode != device.mode) // solved for what the hand held before
    return {};
  if (holds_force(device)) {
    ModelForce held;
    if (snapshot_ != nullptr)
      held.force = snapshot_->force;
    return held;
  }
  topology::ToolPose pose = tool_pose(tool_, device);
  if (organ_ != nullptr && snapshot_ != nullptr && snapshot_->count > 0 && contact_.depth > 0) {
    Vector3 away = contact_.point - snapshot_->contact.point;
    away -= away.dot(contact_.normal) * contact_.normal;
    const double distance = away.norm();
    if (const double reach = rim * snapshot_->reach; distance > reach) {
      pose.point -= (1 - reach / distance) * away;
      outside = true;
    }
  }
  return model_->at(pose, device.time);
}

void HapticTick::arrive(const ContactSnapshot& snapshot) noexcept {
  arrived_ = !model_->solved(snapshot) || snapshot.mode >= static_cast<std::uint16_t>(HandMode::blade) || arrived_;
  fresh_ = true;
  snapshot_ = &snapshot;
}

TickResult HapticTick::tick(const DeviceState& device) noexcept {
  TickResult result;
  locate(device);
  result.contact = contact_;
  result.model = ask(device, result.outside);
  const bool arrives = arrived_;
  if (arrives) {
    arrived_ = false;
    // Where the old snapshot would have had the force now: on from its last two ticks.
    difference_ += 2 * last_model_ - model_before_ - result.model.force;
    fading_ = difference_ / std::max(1.0, std::round(settings_.hand_over * settings_.rate));
  } else if (difference_.squaredNorm() > 0) {
    difference_ =
        difference_.squaredNorm() > fading_.squaredNorm() ? Vector3(difference_ - fading_) : Vector3(Vector3::Zero());
  }
  model_before_ = arrives ? result.model.force : last_model_;
  last_model_ = result.model.force;
  result.tissue = result.model.force + difference_;
  const DeviceLimits& limits = settings_.limits;
  std::optional<double> stored = result.model.stored;
  if (stored)
    *stored *= limits.gain;
  Vector3 force = passivity_.control(device.position, limits.gain * result.tissue, stored);
  if (!device.connected)
    force.setZero();
  if (const double size = force.norm(); size > limits.force) {
    force *= limits.force / size;
    result.limited = true;
  }
  const double largest_step = limits.slew / settings_.rate;
  if (const double step = (force - sent_).norm(); step > largest_step) {
    force = sent_ + largest_step / step * (force - sent_);
    result.limited = true;
  }
  sent_ = force;
  passivity_.sent(force);
  result.force = force;
  result.sequence = snapshot_ != nullptr ? snapshot_->sequence : 0;
  result.energy = passivity_.energy();
  return result;
}

} // namespace spherecut::app
