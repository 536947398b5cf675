// What the hand holds: pose in, force out, once a tick of the haptic loop. The loop knows devices by this interface
// alone: a scripted path, a simulated hand, a recording, a bridge to hardware.
//
// Chosen here: a device gives the pose of the tool's reference point (or of the blade's frame) already in the
// scenario's frame and in metres; force and torque go back, of which a device of three motors renders the force alone;
// and a device has no clock, it is asked once a tick and answers with the newest it has.
#pragma once

#include "src/base/possible.hpp"
#include "src/scenario/haptic_settings.hpp"
#include "src/scenario/schedule.hpp"

#include <Eigen/Geometry>
#include <cstdint>

namespace spherecut::app {

/// As a scenario names it.
std::string_view device_name(HeldDevice device);

/// What the hand holds, as DeviceState::mode has it.
enum class HandMode : std::uint16_t {
  usual,   // the tool, beside which a blade keeps to its own path; the blade in a scenario without a tool
  probe,   // the tool; a blade is lifted
  blade,   // the blade, which cuts where the hand draws it; a tool stays away from the organ
  grasper, // the tool of a scenario whose tool is one; closed while button 1 is pressed
};

/// What is known of the hand behind a device that answers less often than the loop asks.
struct ClientReading {
  Vector3 position = Vector3::Zero(); // m, the newest, to which DeviceState::position is on its way
  double period = 1;                  // ticks between two readings; 1: every tick's position is one, the rest is idle
  double share = 1;                   // of the force that the hand gets
  bool fresh = false;                 // this tick's
};

/// Where a device is at a tick of the haptic loop.
struct DeviceState {
  std::uint64_t tick = 0;             // of the loop
  double time = 0;                    // s, tick / rate of the loop
  Vector3 position = Vector3::Zero(); // m, reference point of the tool, origin of the blade's frame
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity(); // turns +z into the tool's axis; the blade's frame
  bool connected = true;               // false: nobody answers; the loop brings the force to zero
  std::uint16_t mode = 0, buttons = 0; // what the hand has chosen and presses; recorded and replayed with the pose
  ClientReading client{};
};

class Device {
 public:
  virtual ~Device() = default;
  /// The pose at this tick. Called once a tick, ticks rising by one, from the haptic thread alone: neither allocates,
  /// locks nor waits.
  virtual DeviceState read(std::uint64_t tick) noexcept = 0;
  /// Force on the hand, N, until the next call. Called once a tick after read(), under the same conditions.
  virtual void apply(const Vector3& force) noexcept = 0;
  /// The same with the torque on the hand about the reference point, N m. It is this that a loop calls; a device that
  /// renders no torque need not know of it.
  virtual void render(const Vector3& force, const Vector3& /*torque*/) noexcept { apply(force); }
};

enum class WhichHand : std::uint8_t { first, second };

/// Both hands at a tick of a loop.
struct Hands {
  DeviceState first;
  /// The blade in the other hand, beside the tool in the first, in mode `usual` or `blade`. Empty: there is no other
  /// hand, or it holds nothing.
  Possible<DeviceState> second;
  bool are_two = false; // there is a second device: a blade that nobody holds goes nowhere

  Hands() = default;
  Hands(const DeviceState& one) : first(one) {} // NOLINT(google-explicit-constructor): one hand alone
};

/// Where both devices are at a tick; `second` (null: there is none) holds the blade in the modes `usual` and `blade`,
/// unless the first hand has it. To be called as Device::read is.
Hands read_hands(Device& first, Device* second, std::uint64_t tick) noexcept;

/// The state of a hand that is known to hold the blade, in that mode.
DeviceState with_blade(DeviceState hand) noexcept;

/// A hand that holds nothing, at the tick of another: it feels no force.
DeviceState idle_hand(const DeviceState& other) noexcept;

/// A pose at a time of a path.
struct PathPose {
  double time = 0; // s
  Vector3 position = Vector3::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// Pose on a path at a time: straight and evenly turned between poses, at rest before the first and after the last.
/// Allocates nothing.
PathPose path_pose(const std::vector<PathPose>& path, double time) noexcept;

/// The way of the tool through the moments of a run, or of the blade when there is no tool. Throws InputError when
/// there is neither.
std::vector<PathPose> driven_path(const std::vector<StepSample>& steps);

/// The way of the blade through the moments of a run. Throws InputError when there is none.
std::vector<PathPose> blade_path(const std::vector<StepSample>& steps);

/// Follows a path whatever the force: an open loop.
class ScriptedPath : public Device {
 public:
  /// `rate` in ticks per second. Throws InputError unless there is a pose, times rise and the rate is positive.
  ScriptedPath(std::vector<PathPose> path, double rate);
  DeviceState read(std::uint64_t tick) noexcept override;
  void apply(const Vector3& /*force*/) noexcept override {}

 private:
  std::vector<PathPose> path_;
  double rate_;
};

/// Mass on spring and damper: m x'' = k (path - x) + b (path' - x') + force, integrated with ten semi-implicit Euler
/// steps a tick. The force closes the loop. Orientation follows the path.
class SimulatedHand : public Device {
 public:
  /// Throws InputError when mass or rate is not positive, another setting is negative or the delay exceeds 15 ticks.
  SimulatedHand(std::vector<PathPose> path, const HandSettings& settings, double rate);
  DeviceState read(std::uint64_t tick) noexcept override;
  void apply(const Vector3& force) noexcept override;

  /// Where the hand is now, unquantised, m; and its velocity, m/s.
  [[nodiscard]] const Vector3& position() const { return position_; }
  [[nodiscard]] const Vector3& velocity() const { return velocity_; }
  /// Work done on the loop so far, J: minus that of the acting force over the true motion.
  [[nodiscard]] double work() const { return work_; }

 private:
  static constexpr int longest_delay = 15;
  std::vector<PathPose> path_;
  HandSettings settings_;
  double rate_;
  Vector3 position_ = Vector3::Zero(), velocity_ = Vector3::Zero();
  std::array<Vector3, longest_delay + 1> forces_{}; // newest first
  double work_ = 0;
  std::size_t leg_ = 0; // of the path, that it was on last
  bool started_ = false;
};

} // namespace spherecut::app
