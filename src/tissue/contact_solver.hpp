// The contact of a session: the tool pressed into its patch, which grows where the tool goes beyond it, and the surface
// between the nodes kept out of the tool.
#pragma once

#include "src/tissue/background_bodies.hpp"
#include "src/tissue/blade_track.hpp"
#include "src/tissue/grasping.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// Of the spacing: deepest that a point of the surface may be left in the tool.
inline constexpr double most_left_over = 0.02;

/// What it remembers of the last solution is that of the body that was solved last: it is asked for a model and answers
/// of that model.
class ContactSolver {
 public:
  /// All of these must outlive it.
  ContactSolver(SessionState& state, const Grasping& grasping, const BladeTrack& blade,
                const BackgroundBodies& background);

  /// Friction goes on from the solution of the last step, should the nodes change in this one.
  void begin_step();
  /// Another body takes over from the present one: friction goes on from here.
  void keep_grip();
  /// That body is to be solved in the same step.
  void go_on_with_kept_grip();

  /// Solves the model for tool, or grasper, and lips in contact. Throws NumericalError, and InputError where nothing
  /// can be touched.
  void solve(const StepSample& sample, BodyModel& model);
  /// The same of a body that is looked at beside the present one, of which all is told that is told after this.
  void solve_beside(const StepSample& sample, BodyModel& model);
  /// Condenses the model onto those of the candidates that are still there.
  void condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses = false);
  /// Surface nodes that the tool may touch, or that the grasper holds.
  [[nodiscard]] std::vector<int> candidates(const BodyModel& model) const;
  /// The same, none where the tool is out of reach.
  [[nodiscard]] std::vector<int> candidates_in_reach(const BodyModel& model) const;
  /// Whether the tool can be on the surface, as far as that has moved by now.
  [[nodiscard]] bool is_in_reach() const;

  /// Displacements at the nodes, 3 a node, m; those asked for last are kept.
  const VectorX& displacements(const BodyModel& model);
  /// Of the surface in the last solution; empty: not looked at.
  [[nodiscard]] const std::optional<SurfaceWatch::Depths>& penetration() const { return penetration_; }

 private:
  [[nodiscard]] std::optional<solvers::GripMemory> remembered_grip() const;
  void press(const topology::ToolPose* pose, BodyModel& model);
  [[nodiscard]] std::vector<int> press_surface(const topology::ToolPose* pose, BodyModel& model);
  bool lift_shares(const SurfaceWatch::Depths& depths, const topology::ToolPose& pose, BodyModel& model) const;
  [[nodiscard]] std::vector<int> touchable(std::vector<int> nodes, const topology::ToolPose& pose,
                                           const BodyModel& model) const;
  [[nodiscard]] std::vector<int> penetrated_outside_patch(const topology::ToolPose& pose, const BodyModel& model);
  void extend_fields(BodyModel& model) const;
  void condense_finite(BodyModel& model) const;

  SessionState& state_;
  const Scenario& scenario_;
  const Organ& organ_;
  const FineZoneTracker& zone_;
  const Grasping& grasping_;
  const BladeTrack& blade_;
  const BackgroundBodies& background_;
  VectorX displaced_, displaced_coefficients_;              // at the nodes, of a field since solve() began
  const solvers::Discretisation* displaced_body_ = nullptr; // of that field; null: none
  std::optional<SurfaceWatch::Depths> penetration_;
  bool lips_touch_ = false;                        // pairs were held in the last solution
  std::optional<solvers::GripMemory> grip_memory_; // friction at the start of the step, should its nodes change
  std::optional<solvers::GripMemory> kept_grip_;   // of a body that another has taken over from since the last step
};

} // namespace spherecut::app
