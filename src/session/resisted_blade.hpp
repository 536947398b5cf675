// A blade that the tissue resists (src/blade/force.hpp): it goes on against the body as it is and cuts as far as its
// work allows.
#pragma once

#include "src/session/step_result.hpp"
#include "src/session/tear_fronts.hpp"
#include "src/tissue/body_updater.hpp"

namespace spherecut::app {

/// Its next cut, the proposal, is made ahead of it: then the incision is ahead of the body, and can go back to the mark
/// that was set before.
class ResistedBlade {
 public:
  /// All of these must outlive it. Throws InputError as BladeEdge.
  ResistedBlade(SessionState& state, const BladeTrack& blade, ContactSolver& contact, BackgroundBodies& background,
                BodyUpdater& updater, const TearFronts& fronts);

  [[nodiscard]] const BladeForce& force() const { return force_; }
  /// Whether a part of the edge is inside the body at the pose of the sample, if that has one.
  [[nodiscard]] bool enters(const StepSample& sample) const;
  /// The blade goes to the pose of the sample against the solved body, and cuts on its way; at the end of its path,
  /// where the sample has no pose, it makes the cut that is still to come. Returns the energy of the surface that it
  /// makes, J.
  double press(const StepSample& sample, CutReport& report);
  /// The field of the solved body becomes that under the blade; without_blade keeps the other.
  void load_body();
  /// Gives the state of a grasper the forces that it has under the blade; at finite strain it has them.
  void load_grasper(solvers::ContactState& grasper, const topology::ToolPose& pose) const;

  /// The hand has let go of it: it is nowhere until it is put somewhere.
  void lift();
  /// What it is to cut next is made again: nodes have gone along with the tool.
  void withdraw();
  /// The proposal is not taken any more, and none that is under way; the cut is that of the body again.
  void drop_proposal();
  [[nodiscard]] bool has_proposal() const { return mark_.has_value(); }
  /// The cut has grown otherwise: the blade meets the body as it is now, and nothing is proposed.
  void meet_again() { force_.meet_again(state_.model); }
  /// Whether it is left so far behind its pose that there is a cut to come, which is made in the background.
  [[nodiscard]] bool lags_in_background() const { return proposes_in_background() && force_.lags(); }

 private:
  [[nodiscard]] bool proposes_in_background() const;
  double press_at(const StepSample& sample, CutReport& report);
  void leave(const StepSample& sample);
  void look_at_loads(double time);
  void watch_overload(double time, bool has_cut);
  void follow_tool(const StepSample& sample);
  double cut_on(const StepSample& sample, bool in_background, CutReport& report);
  bool sweep(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report);
  bool propose(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report);
  void build_in_background(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report);
  void take(const StepSample& sample, CutReport& report);
  void forget_mark();

  SessionState& state_;
  const BladeTrack& blade_;
  ContactSolver& contact_;
  BackgroundBodies& background_;
  BodyUpdater& updater_;
  const TearFronts& fronts_;
  BladeForce force_;
  std::string renewed_;                       // why all nodes are made anew for the last cut; empty: they are not
  int overloads_ = 0;                         // steps on end with too much behind the edge, and no cut
  bool touched_ = false;                      // the tool was in reach in the last step,
  std::optional<topology::ToolPose> tool_;    // there
  std::optional<IncisionBuilder::Mark> mark_; // the cut without the proposal; empty: there is none
};

} // namespace spherecut::app
