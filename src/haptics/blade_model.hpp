// The force on a blade in the hand between two solves (src/blade/grip.hpp).
#pragma once

#include "src/haptics/contact_snapshot.hpp"
#include "src/haptics/force_model.hpp"

namespace spherecut::app {

/// Neither allocates, locks, waits nor throws.
class BladeModel {
 public:
  /// A new solve; true when a blade is or was in the body, so that the force is another.
  bool solved(const ContactSnapshot& snapshot) noexcept;
  [[nodiscard]] bool pressing() const { return grip_.contacts > 0; }
  /// With the blade's frame at `position`, m, turned by `orientation`, at `time`, s. The flanks' drag turns over within
  /// drag_travel when the edge goes back. A blade that a solve has found in the body comes to its force, and to the
  /// energy behind it, evenly within `onset`: both go on from none.
  ModelForce at(const Vector3& position, const Eigen::Quaterniond& orientation, double time) noexcept;
  static constexpr double onset = 0.05; // s

 private:
  BladeGrip grip_;
  Vector3 solved_at_ = Vector3::Zero(), last_ = Vector3::Zero(); // m
  Eigen::Quaterniond solved_turn_ = Eigen::Quaterniond::Identity(), last_turn_ = Eigen::Quaterniond::Identity();
  double drag_ = 0;    // share of the flanks' drag: 1 along the way, -1 back
  bool found_ = false; // in the body, and not asked since
  double entered_ = 0; // s
};

} // namespace spherecut::app
