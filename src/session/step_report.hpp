// What a step tells of the solved body: forces, how well it is solved, the cut; and what is odd about it.
#pragma once

#include "src/session/resisted_blade.hpp"
#include "src/session/step_result.hpp"

namespace spherecut::app {

class StepReport {
 public:
  /// These must outlive it.
  StepReport(SessionState& state, ContactSolver& contact, const Grasping& grasping)
      : state_(state), contact_(contact), grasping_(grasping) {}

  /// Of a linear body, solved without the blade; `blade` null: none is resisted. The field of the model becomes that
  /// under the blade. Throws NumericalError when a force is not finite.
  void tell_linear(ResistedBlade* blade, StepResult& result);
  /// Of a body at finite strain.
  void tell_finite(ResistedBlade* blade, StepResult& result);
  /// The cut as it is; `blade` as above.
  void tell_cut(const ResistedBlade* blade, CutReport& report);

 private:
  void tell_nodes(StepResult& result);
  [[nodiscard]] bool is_at_front(const Vector3& x) const;
  void judge_contact(const StepResult& result);
  void judge_fineness(const StepResult& result);
  void judge_banks(StepResult& result);
  [[nodiscard]] double depth_of_press(const topology::SurfaceContact& contact) const;
  void tell_opening(const topology::Wound& wound, CutReport& report);

  SessionState& state_;
  ContactSolver& contact_;
  const Grasping& grasping_;
};

} // namespace spherecut::app
