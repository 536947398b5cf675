// One tick of the haptic loop as a function of what has been, without a clock: pose in, force and torque out. The
// threads' shell (realtime_loop.hpp) and the loop in virtual time (virtual_loop.hpp) both run it, so a recorded session
// replays bit by bit.
#pragma once

#include "src/haptics/client_passivity.hpp"
#include "src/haptics/device.hpp"
#include "src/haptics/force_model.hpp"
#include "src/haptics/passivity.hpp"

namespace spherecut::app {

/// m/s. From one tick to the next no hand moves a tool faster than this: with instruments hands stay below 0.5 m/s.
/// What does is no motion, the tool has been placed anew.
inline constexpr double fastest_hand = 1.5;

/// Pose of a tool that a device holds; an instrument's axis points to its port.
topology::ToolPose tool_pose(const topology::ToolShape& tool, const DeviceState& device) noexcept;

/// What a tick gives.
struct TickResult {
  Vector3 force = Vector3::Zero();         // N, on the hand
  ModelForce model;                        // before hand-over, gain and limits
  Vector3 tissue = Vector3::Zero();        // N, model and hand-over: what the tissue is said to do to the tool
  Vector3 torque = Vector3::Zero();        // N m, on the hand, about the tool's reference point (of the blade's frame)
  Vector3 tissue_torque = Vector3::Zero(); // N m, model and hand-over
  topology::SurfaceContact contact;        // deepest point on the surface at rest
  std::uint64_t sequence = 0;              // of the snapshot in use
  double energy = 0;                       // J, put in by the hand so far
  double softened = 1;                     // share of the force that is rendered, for the device's stiffness
  bool limited = false;                    // by saturation or slew
  bool outside = false;                    // the contact has left the candidates of the snapshot
};

/// What is handed over at a solve: it goes on from where it would have been now, by its last two ticks, and the
/// difference to what the model says fades linearly.
class HandOver {
 public:
  /// One tick of what the model says. `arrives`: it has a new solve, over whose difference `ticks` pass; `anew`: nobody
  /// felt anything before. Returns what is felt.
  Vector3 pass(const Vector3& model, bool arrives, bool anew, double ticks) noexcept;
  [[nodiscard]] const Vector3& last() const { return last_; }

 private:
  Vector3 last_ = Vector3::Zero(), before_ = Vector3::Zero(); // of the last two ticks
  Vector3 difference_ = Vector3::Zero();                      // still to fade
  Vector3 fading_ = Vector3::Zero();                          // per tick
};

/// Neither allocates, locks, waits nor throws after construction. A tick with a new snapshot is arrive(snapshot);
/// tick(state); any other is tick(state). From arrive() on the snapshot before may go.
///
/// At a new snapshot the force goes on from where the old one would have had it, by its last two ticks: the difference
/// is added and fades linearly within HapticSettings::hand_over. Energy behind a blade, and behind what a tool holds,
/// counts as stored once the hand has put it in: a solve that finds more of it is no reason to damp. When the contact
/// leaves the candidates, the patch is taken along with the tool: the model is asked as if the tool were still at their
/// rim. Of a grasper the force is that of the last solve. A mode that leaves the tool in the hand changes nothing
/// before its first solve; where tool and blade change places there is no force until then. Both are handed over as a
/// solve is. A device that does not answer brings the force to zero at the slew limit.
///
/// The torque is that of the same model, is handed over and rendered by the same shares as the force, and is limited on
/// its own besides (DeviceLimits::torque). Its work is not counted: a hand that a device turns has to keep its turning
/// steady by its own damping. The damping of the controller is a force at the reference point, and has no torque.
///
/// Energy is counted where it flows: at every tick, or from reading to reading of a client that gives fewer
/// (DeviceState::client). Such a client gets its force as late as it interpolates, once more as it holds it, and may
/// not be stiffer than what its damper (DeviceLimits::damping) keeps from swinging over that time; a share of the force
/// below 1 is that of a client too slow for any.
///
/// A tool that has moved faster than fastest_hand is placed anew, and so is one that somebody has just taken up: no
/// work is counted for the way there, nothing is owed for what was before, and what energy it meets there, also by the
/// first solve from there, has been found. The force is handed over, from none where nobody held the tool.
class HapticTick {
 public:
  /// `organ` follows the contact of a tool, and the edge of a blade, on the surface at rest; null: not followed. Tool
  /// and organ must outlive this. `with_tool` false: there is a blade alone.
  HapticTick(const HapticSettings& settings, const topology::ToolShape& tool, const topology::ContactQuery* organ,
             bool with_tool = true);

  /// Where the walk over the surface starts; before the first tick.
  void start(const DeviceState& device);
  void arrive(const ContactSnapshot& snapshot) noexcept;
  TickResult tick(const DeviceState& device) noexcept;
  /// Fetches what the next tick will read into the processor's caches, where another thread has had them meanwhile.
  /// Changes nothing: for the time in which a tick is waited for.
  void fetch() const noexcept;

  /// Of a device that answers at every tick, and of a client that does not.
  [[nodiscard]] const PassivityControl& passivity() const { return passivity_; }

 private:
  enum class Origin { none, tool, grasper, blade }; // of the force
  [[nodiscard]] Origin origin(const DeviceState& device) const noexcept;
  [[nodiscard]] ModelForce ask(const DeviceState& device, bool& outside) noexcept;
  void locate(const DeviceState& device) noexcept;
  [[nodiscard]] double share_inside(const Vector3& position) noexcept;
  void soften(const ModelForce& model, const DeviceState& device) noexcept;
  [[nodiscard]] Vector3 rendered_torque(const Vector3& tissue, double share) noexcept;
  [[nodiscard]] double steady_stiffness(const DeviceState& device) const noexcept;
  void choose_controller(const DeviceState& device) noexcept;
  void place_controller() noexcept;
  void find_energy() noexcept;
  [[nodiscard]] bool jumps(const DeviceState& device) const noexcept;

  HapticSettings settings_;
  const topology::ToolShape& tool_;
  const topology::ContactQuery* organ_;
  bool with_tool_;
  std::unique_ptr<ForceModel> model_;
  PassivityControl passivity_;
  ClientPassivity client_;
  bool slow_client_ = false; // in the last tick: then the latter controls
  const ContactSnapshot* snapshot_ = nullptr;
  topology::SurfaceContact contact_;
  std::array<topology::SurfaceContact, BladeGrip::most_places> edge_; // of the blade's edge and the surface
  std::array<double, BladeGrip::most_places> edge_depth_{};           // m, below that where it was solved; at most 0
  bool edge_fresh_ = false;                                           // a solve has come since they were found
  std::uint64_t located_ = 0;          // tick after which contact_ was found, plus one; 0: never
  bool arrived_ = false;               // a snapshot that changes the force has come since the last tick
  bool fresh_ = false;                 // any snapshot has
  Origin origin_ = Origin::none;       // in the last tick
  HandOver force_, torque_;            // N, N m
  double paid_ = 0;                    // J, of what is stored behind a force that solves find: put in by the hand
  Vector3 position_ = Vector3::Zero(); // m, of the last tick
  topology::ToolPose located_pose_;    // of the tool, where contact_ was found
  bool connected_ = false;             // in the last tick
  bool finds_ = false;                 // no solve has come from where the tool was placed last,
  std::uint64_t placed_ = 0;           // at this tick
  double softened_ = 1;
  Vector3 sent_ = Vector3::Zero(), sent_torque_ = Vector3::Zero();
};

} // namespace spherecut::app
