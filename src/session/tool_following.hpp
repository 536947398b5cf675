// Fine nodes go along with the tool: in the step, or on a body made in the background.
#pragma once

#include "src/session/step_result.hpp"
#include "src/tissue/body_updater.hpp"

namespace spherecut::app {

class ToolFollowing {
 public:
  /// These must outlive it.
  ToolFollowing(SessionState& state, ContactSolver& contact, BodyUpdater& updater, BackgroundBodies& background)
      : state_(state), contact_(contact), updater_(updater), background_(background) {}

  /// The fine zone goes to where the contact is, and the body is built and solved there.
  void follow(const StepSample& sample, const topology::SurfaceContact& centre, StepResult& result);
  /// The same in the background: begins that, or takes it over once the contact has left the zone.
  void follow_in_background(const StepSample& sample, const topology::SurfaceContact& centre);
  /// The body that has followed the tool takes over, after waiting for it. Throws what making it has thrown; the body
  /// is then as it was.
  void take();
  /// Whether one has since this was asked last.
  [[nodiscard]] bool has_taken() { return std::exchange(taken_, false); }

 private:
  void say_not_followed(const std::exception& error);

  SessionState& state_;
  ContactSolver& contact_;
  BodyUpdater& updater_;
  BackgroundBodies& background_;
  bool taken_ = false;
};

} // namespace spherecut::app
