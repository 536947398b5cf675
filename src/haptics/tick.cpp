#include "src/haptics/tick.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double softening = 50;     // per second, at most, by which the rendered share of the force falls
constexpr double hardening = 2;      // the same as it rises
constexpr double force_age = 2;      // times a slow client's time between two readings: interpolated, then held
constexpr double least_damper = 1;   // N s/m, that a hand has in any case
constexpr double out_of_body = 1e-3; // m, over which a blade's edge comes clear of the surface
constexpr double one_place = 1e-3;   // m, within which two contacts are one, that the same walk follows
constexpr double patch_rim = 0.8;    // of the candidates' reach: a contact beyond it takes the patch along

const topology::ToolShape edge_point = topology::SphereTip{1e-9};

// A grasper's force is that of the last solve, held.
bool holds_force(const ContactSnapshot& snapshot) {
  return snapshot.mode >= static_cast<std::uint16_t>(HandMode::grasper);
}

bool holds_blade(std::uint16_t mode, const ContactSnapshot& snapshot) {
  return mode == static_cast<std::uint16_t>(HandMode::blade) ||
         (mode == static_cast<std::uint16_t>(HandMode::usual) && snapshot.without_tool);
}

// Whether the hand holds what the snapshot was solved for, in whatever mode.
bool same_thing(const DeviceState& device, const ContactSnapshot& snapshot) {
  return holds_blade(device.mode, snapshot) == holds_blade(snapshot.mode, snapshot);
}

bool follows_surface(const DeviceState& device) {
  return device.mode < static_cast<std::uint16_t>(HandMode::blade);
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
                       const topology::ContactQuery* organ, bool with_tool)
    : settings_(settings), tool_(tool), organ_(organ), with_tool_(with_tool && organ != nullptr),
      model_(make_force_model(settings.model, tool)), passivity_(settings.limits, settings.rate, settings.passivity),
      client_(settings.limits, settings.rate, settings.passivity) {}

void HapticTick::start(const DeviceState& device) {
  if (with_tool_)
    contact_ = organ_->first_touch(tool_, tool_pose(tool_, device));
}

void HapticTick::locate(const DeviceState& device) noexcept {
  if (!with_tool_ || located_ == device.tick + 1 || !follows_surface(device))
    return;
  const topology::ToolPose pose = tool_pose(tool_, device);
  contact_ = organ_->walk(tool_, pose, contact_);
  // A tool that was put elsewhere leaves the walk behind; the solve has looked at the whole surface.
  if (fresh_ && same_thing(device, *snapshot_) && (snapshot_->contact.point - contact_.point).norm() > one_place) {
    const topology::SurfaceContact there = organ_->walk(tool_, pose, snapshot_->contact);
    if (there.depth > contact_.depth)
      contact_ = there;
  }
  fresh_ = false;
  located_ = device.tick + 1;
  located_pose_ = pose;
}

void HapticTick::fetch() const noexcept {
  if (with_tool_ && located_ > 0)
    static_cast<void>(organ_->walk(tool_, located_pose_, contact_));
  model_->fetch();
}

// Of the places of the edge that pressed in the last solve. A solve can take long, and the blade be out by then: over a
// millimetre above the surface at rest, or above where it was above that already, its force fades.
double HapticTick::share_inside(const Vector3& position) noexcept {
  const BladeGrip& grip = snapshot_->blade;
  if (organ_ == nullptr || grip.places == 0)
    return 1;
  const auto depth_at = [&](const Vector3& from, std::size_t k) {
    edge_[k] = organ_->walk(edge_point, {from + grip.place[k], Vector3::UnitZ()}, edge_[k]);
    return edge_[k].depth;
  };
  const bool is_new = std::exchange(edge_fresh_, false);
  double sum = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(grip.places); ++k) {
    if (is_new)
      edge_depth_[k] = std::min(0.0, depth_at(snapshot_->pose.point, k));
    sum += std::clamp(1 + (depth_at(position, k) - edge_depth_[k]) / out_of_body, 0.0, 1.0);
  }
  return sum / grip.places;
}

HapticTick::Origin HapticTick::origin(const DeviceState& device) const noexcept {
  if (snapshot_ == nullptr || !same_thing(device, *snapshot_))
    return Origin::none;
  if (holds_force(*snapshot_))
    return Origin::grasper;
  return holds_blade(device.mode, *snapshot_) ? Origin::blade : Origin::tool;
}

ModelForce HapticTick::ask(const DeviceState& device, bool& outside) noexcept {
  outside = false;
  if (origin_ == Origin::none)
    return {};
  if (origin_ == Origin::grasper) {
    ModelForce held;
    held.force = snapshot_->force;
    held.torque = snapshot_->torque;
    return held;
  }
  topology::ToolPose pose = tool_pose(tool_, device);
  if (origin_ == Origin::blade) {
    ModelForce held = model_->at(pose, device.orientation, device.time);
    const double share = held.active > 0 ? share_inside(device.position) : 1;
    held.force *= share;
    held.torque *= share;
    held.stiffness *= share;
    if (held.stored)
      *held.stored *= share;
    held.active = share > 0 ? held.active : 0;
    return held;
  }
  if (follows_surface(device) && with_tool_ && snapshot_->count > 0 && contact_.depth > 0) {
    Vector3 away = contact_.point - snapshot_->contact.point;
    away -= away.dot(contact_.normal) * contact_.normal;
    const double distance = away.norm();
    if (const double reach = patch_rim * snapshot_->reach; distance > reach) {
      pose.point -= (1 - reach / distance) * away;
      outside = true;
    }
  }
  return model_->at(pose, device.orientation, device.time);
}

double HapticTick::steady_stiffness(const DeviceState& device) const noexcept {
  const DeviceLimits& limits = settings_.limits;
  if (device.client.period <= 1)
    return limits.stiffness;
  const double late = force_age * device.client.period / settings_.rate; // s
  return std::min(limits.stiffness, std::max(limits.damping, least_damper) / late);
}

// With the controller on, a contact stiffer than the device renders steadily is rendered as stiff as that: by a share
// of its force, which falls faster than it rises. At a slow client it is there from the first touch on.
void HapticTick::soften(const ModelForce& model, const DeviceState& device) noexcept {
  if (!settings_.passivity || !(model.force.squaredNorm() > 0))
    return;
  const double stiffness = settings_.limits.gain * model.stiffness;
  const double steady = steady_stiffness(device);
  const double share = stiffness > steady ? steady / stiffness : 1;
  const bool slow = device.client.period > 1;
  if (slow && force_.last().squaredNorm() == 0)
    softened_ = share;
  const double falling = slow ? hardening : softening; // its rate is measured anew with each of its poses
  softened_ += std::clamp(share - softened_, -falling / settings_.rate, hardening / settings_.rate);
}

Vector3 HandOver::pass(const Vector3& model, bool arrives, bool anew, double ticks) noexcept {
  // On at a solve too: solves that come in every tick would hold the force where it was otherwise.
  if (difference_.squaredNorm() > 0)
    difference_ =
        difference_.squaredNorm() > fading_.squaredNorm() ? Vector3(difference_ - fading_) : Vector3(Vector3::Zero());
  if (arrives) {
    // Where the force would have been now: on from its last two ticks. In nobody's hand there was none.
    difference_ += 2 * last_ - before_ - model;
    if (anew)
      difference_ = -model;
    fading_ = difference_ / ticks;
  }
  before_ = arrives ? model : last_;
  last_ = model;
  return model + difference_;
}

void HapticTick::place_controller() noexcept {
  passivity_.place();
  client_.place();
}

void HapticTick::find_energy() noexcept {
  passivity_.find();
  client_.find();
}

// The one that has not counted meanwhile begins anew.
void HapticTick::choose_controller(const DeviceState& device) noexcept {
  const bool slow = device.client.period > 1;
  if (slow == slow_client_)
    return;
  slow_client_ = slow;
  if (slow)
    client_.place();
  else
    passivity_.place();
}

bool HapticTick::jumps(const DeviceState& device) const noexcept {
  return (device.position - position_).norm() * settings_.rate > fastest_hand;
}

void HapticTick::arrive(const ContactSnapshot& snapshot) noexcept {
  arrived_ = !model_->solved(snapshot) || holds_force(snapshot) || arrived_;
  fresh_ = true;
  edge_fresh_ = true;
  snapshot_ = &snapshot;
}

// At a share of the tissue's, within the device's limit, which is reached as fast as that of the force.
Vector3 HapticTick::rendered_torque(const Vector3& tissue, double share) noexcept {
  const DeviceLimits& limits = settings_.limits;
  Vector3 torque = share * tissue;
  if (const double size = torque.norm(); size > limits.torque)
    torque *= limits.torque / size;
  const double largest_step = limits.slew / limits.force * limits.torque / settings_.rate;
  if (const double step = (torque - sent_torque_).norm(); step > largest_step)
    torque = sent_torque_ + largest_step / step * (torque - sent_torque_);
  sent_torque_ = torque;
  return torque;
}

TickResult HapticTick::tick(const DeviceState& device) noexcept {
  TickResult result;
  locate(device);
  result.contact = contact_;
  const bool taken_up = device.connected && !connected_;
  connected_ = device.connected;
  const bool placed = taken_up || jumps(device);
  if (placed) {
    position_ = device.position;
    placed_ = device.tick;
    finds_ = true;
    place_controller();
  }
  choose_controller(device);
  const Origin before = std::exchange(origin_, origin(device));
  const bool turns = before != origin_;
  const bool found = finds_ && snapshot_ != nullptr && snapshot_->pose_tick >= placed_;
  if (turns || found)
    find_energy();
  finds_ = finds_ && !found;
  const bool arrives = std::exchange(arrived_, false) || turns || placed;
  result.model = ask(device, result.outside);
  soften(result.model, device);
  const double ticks = std::max(1.0, std::round(settings_.hand_over * settings_.rate));
  result.tissue = force_.pass(result.model.force, arrives, taken_up, ticks);
  result.tissue_torque = torque_.pass(result.model.torque, arrives, taken_up, ticks);
  const DeviceLimits& limits = settings_.limits;
  result.softened = softened_;
  const double gain = softened_ * limits.gain;
  std::optional<double> stored = result.model.stored;
  const double work = -result.tissue.dot(device.position - position_);
  paid_ = result.model.found ? std::clamp(paid_ + work, 0.0, stored.value_or(0)) : 0;
  position_ = device.position;
  if (result.model.found)
    stored = paid_;
  if (stored)
    *stored *= gain;
  if (slow_client_ && !stored && result.model.stiffness > 0) // of a spring as stiff as the contact
    stored = gain * result.tissue.squaredNorm() / (2 * result.model.stiffness);
  const Vector3 wanted = gain * result.tissue;
  Vector3 force = slow_client_ ? client_.control(device.client, device.position, wanted, stored.value_or(0))
                               : passivity_.control(device.position, wanted, stored);
  double share = gain * device.client.share; // of what the tissue does
  if (slow_client_ && wanted.squaredNorm() > 0)
    share *= std::clamp(force.dot(wanted) / wanted.squaredNorm(), 0.0, 1.0);
  force *= device.client.share;
  if (!device.connected) {
    force.setZero();
    share = 0;
  }
  if (const double size = force.norm(); size > limits.force) {
    force *= limits.force / size;
    share *= limits.force / size;
    result.limited = true;
  }
  const double largest_step = limits.slew / settings_.rate;
  if (const double step = (force - sent_).norm(); step > largest_step) {
    force = sent_ + largest_step / step * (force - sent_);
    result.limited = true;
  }
  sent_ = force;
  passivity_.sent(force);
  client_.sent(force);
  result.force = force;
  result.torque = rendered_torque(result.tissue_torque, share);
  result.sequence = snapshot_ != nullptr ? snapshot_->sequence : 0;
  result.energy = passivity_.energy() + client_.energy();
  return result;
}

} // namespace spherecut::app
