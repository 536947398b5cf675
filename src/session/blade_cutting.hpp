// A blade that nothing resists: carried to the tissue at rest, the incision it makes, and the body that follows it, at
// once or when the blade has gone far enough (blade.advance).
#pragma once

#include "src/tissue/body_updater.hpp"

namespace spherecut::app {

class BladeCutting {
 public:
  /// These must outlive it.
  BladeCutting(SessionState& state, BladeTrack& blade, ContactSolver& contact, const Grasping& grasping,
               BackgroundBodies& background, BodyUpdater& updater);

  /// Moves the blade, or keeps its motion for later: until it has gone blade.advance, the body need not follow. What is
  /// left is cut when the blade leaves the body, is lifted or gone, or the run ends. A refusal leaves body, incision
  /// and wound as they were. True: a body with a new cut has been solved.
  bool move(const StepSample& sample, CutReport& report);

  /// The cut that is made in the background takes over, after waiting for it; the next step tells of it. Where its body
  /// could not be made the cut is refused: false.
  bool take();
  /// The same in a step, which solves that body.
  void wait_for(const StepSample& sample, CutReport& report);
  /// What take() has left for the next step to tell; nothing more is left then.
  [[nodiscard]] std::optional<CutReport> take_report() { return std::exchange(taken_, std::nullopt); }

 private:
  bool cut(const StepSample& sample, bool places, CutReport& report);
  bool build(const StepSample& sample, std::optional<topology::Wound> wound_before, CutReport& report);
  [[nodiscard]] bool is_put_off(const StepSample& sample);
  [[nodiscard]] bool ends(const StepSample& sample) const;
  [[nodiscard]] bool makes_in_background(const StepSample& sample) const;
  [[nodiscard]] double advance() const; // m

  SessionState& state_;
  BladeTrack& blade_;
  ContactSolver& contact_;
  const Grasping& grasping_;
  BackgroundBodies& background_;
  BodyUpdater& updater_;
  std::optional<CutReport> taken_; // of the cut whose body has taken over since the last step, or which was refused
};

/// Warns of a blade that cuts nothing, or less than it looks, on the organ at rest. `fine`, m: spacing of the nodes
/// where it cuts.
void watch_blade_way(const Scenario& scenario, const topology::Domain& domain, const topology::Incision* incision,
                     double fine, SessionLog& log);

} // namespace spherecut::app
