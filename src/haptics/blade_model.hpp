// The force on a blade in the hand between two solves (src/blade_grip.hpp).
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
  /// With the blade's frame at `position`, m. The flanks' drag turns over within drag_travel when the blade turns back.
  ModelForce at(const Vector3& position) noexcept;

 private:
  BladeGrip grip_;
  Vector3 solved_at_ = Vector3::Zero(), last_ = Vector3::Zero(); // m
  double drag_ = 0;                                              // share of the flanks' drag: 1 along the way, -1 back
};

} // namespace spherecut::app
