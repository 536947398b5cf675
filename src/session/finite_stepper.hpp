// Steps of a session whose law is not linear: its body is one at finite strain, on nodes that stay until a blade cuts.
#pragma once

#include "src/session/step_report.hpp"

namespace spherecut::app {

class FiniteStepper {
 public:
  /// These must outlive it.
  FiniteStepper(SessionState& state, StepReport& report) : state_(state), report_(report) {}

  /// Goes on to the step, with the cut that it has made; `was_cut`: the body with that is solved already. Throws
  /// NumericalError, which says what may help.
  void step(const StepSample& sample, bool was_cut, StepResult& result);

 private:
  SessionState& state_;
  StepReport& report_;
  std::optional<topology::ToolPose> free_pose_; // of the tool before it touched
  double free_time_ = 0;                        // s, then
};

/// Where the tool touches on its way, as far apart as the contact may leave the centre of a fine zone.
std::vector<Vector3> places_of_contact(const SessionState& state);

} // namespace spherecut::app
