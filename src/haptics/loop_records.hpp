// What a haptic session leaves behind: every tick and every solve, enough to replay it.
#pragma once

#include "solvers/contact/blade_contact.hpp"
#include "src/haptics/tick.hpp"

namespace spherecut::app {

/// What a tick did for the second hand, which holds the blade.
struct SecondHandRecord {
  DeviceState device;
  Vector3 force = Vector3::Zero();         // N, on the hand
  Vector3 tissue = Vector3::Zero();        // N, as TickRecord::tissue
  Vector3 torque = Vector3::Zero();        // N m, on the hand, about the origin of the blade's frame
  Vector3 tissue_torque = Vector3::Zero(); // N m, what belongs to `tissue`
  double energy = 0;                       // J, put in by this hand so far
  bool limited = false;
};

/// One tick.
struct TickRecord {
  DeviceState device;
  Vector3 force = Vector3::Zero();  // N, on the hand
  Vector3 tissue = Vector3::Zero(); // N, of the tissue on the tool, with hand-over, before gain, control and limits
  Vector3 model = Vector3::Zero();  // N, of the model alone
  Vector3 torque = Vector3::Zero(); // N m, on the hand, about the tool's reference point
  Vector3 tissue_torque = Vector3::Zero(); // N m, what belongs to `tissue`
  double energy = 0;                       // J, put in by the hand so far
  double depth = 0;                        // m, of the contact on the surface at rest
  double sinking = 0;                      // m, of the deepest candidate inside the tool
  std::uint64_t sequence = 0;              // of the snapshot in use
  bool arrived = false;                    // it came at this tick
  bool limited = false, outside = false, converged = true;
  double softened = 1; // share of the force that was rendered, for the device's stiffness
  int active = 0, rounds = 0;
  double latency = 0;                // s, from when the tick was due to when it began; 0 in virtual time
  double compute = 0;                // s of the thread's processor time; 0 in virtual time
  Possible<SecondHandRecord> second; // empty: it holds nothing
  bool two_hands = false;            // there is a second device
};

/// A scheduling event: a solve that began at the pose of one tick and was taken over at another.
struct SolveEvent {
  static constexpr std::uint64_t never = ~std::uint64_t{0};
  std::uint64_t sequence = 0;
  std::uint64_t pose_tick = 0;
  std::uint64_t arrival_tick = never; // tick that first used it; never: overtaken by a newer one, failed, or too late
  int degradation = 0;
  bool swaps = false; // it takes over the body that has been made in the background
  /// What follows the tool or a cut that is put off is made there (SessionOptions::following_in_background).
  bool in_background = false;
};

/// One solve, and what it did.
struct SolveRecord {
  SolveEvent event;
  bool failed = false;
  std::string reason; // of the failure
  bool resprinkled = false;
  double force_jump = 0; // by that, as a share of the force; 0 where it was made in the background
  int cut_triangles = 0, nodes = 0, candidates = 0, active = 0;
  std::uint64_t topology = 0;               // of cut surface and nodes, as ContactSnapshot::topology
  double asymmetry = 0;                     // of the compliance
  Vector3 blade_force = Vector3::Zero();    // N, on a blade that the tissue resists, in the hand or beside it
  Vector3 blade_torque = Vector3::Zero();   // N m, of the same about the origin of its frame
  double blade_edge = 0, blade_release = 0; // N, of its edge alone; J/m2, of that on the front
  solvers::BladeLedger blade_account;       // J since the start
  int blade_contacts = 0;                   // pieces of the edge that press
  double residual = 0;                      // of a body to which the cut has appended; 0: not looked at
  double cut_area = 0;                      // m2
  std::string_view update;                  // how the system came to the cut of this solve; empty: nothing was cut
  Vector3 force = Vector3::Zero();          // N, of the solve
  Vector3 torque = Vector3::Zero();         // N m, likewise, about the tool's point or the origin of the blade's frame
  double seconds = 0;                       // wall clock
};

struct LoopRecords {
  std::vector<TickRecord> ticks;
  std::vector<SolveRecord> solves;
};

TickRecord record_of(const DeviceState& device, const TickResult& result, bool arrived) noexcept;
SecondHandRecord second_record_of(const DeviceState& device, const TickResult& result) noexcept;
SolveRecord record_of(const SolveEvent& event, const ContactSnapshot& snapshot);

} // namespace spherecut::app
