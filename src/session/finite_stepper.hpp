// Steps of a session whose law is not linear: its body is one at finite strain, on nodes that stay until a blade cuts.
#pragma once

#include "src/tissue/contact_solver.hpp"
#include "topology/base/errors.hpp"

namespace spherecut::app {

class FiniteStepper {
 public:
  /// These must outlive it.
  FiniteStepper(SessionState& state, ContactSolver& contact) : state_(state), contact_(contact) {}

  /// Goes on to the step, with the cut that it has made; `is_solved`: the body with that is solved already; `is_met`: a
  /// blade that tissue resists has come into it. False: nothing acts on the tissue yet. Throws NumericalError.
  bool solve(const StepSample& sample, bool is_solved, bool is_met);

 private:
  SessionState& state_;
  ContactSolver& contact_;
  std::optional<topology::ToolPose> free_pose_; // of the tool before it touched
  double free_time_ = 0;                        // s, then
};

/// What a solution says that is not found, at `time`, s: why, what drives the body there, and what may help.
/// `is_cutting`: a blade is there.
std::string without_equilibrium(const SessionState& state, double time, bool is_cutting, const NumericalError& error);

/// Where the tool touches on its way, as far apart as the contact may leave the centre of a fine zone.
std::vector<Vector3> places_of_contact(const SessionState& state);

} // namespace spherecut::app
