// One palpation: the organ, its nodes about the contact, and the tool pressed into it step by step. A step reads like
// the paper: contact, sprinkle, supports and collocation, solve, force [De 2001, sections 2 and 3].
#pragma once

#include "src/organ.hpp"
#include "src/scenario.hpp"
#include "src/tool_motion.hpp"

#include <functional>

namespace spherecut::app {

/// Outcome of one step.
struct StepResult {
  double time = 0; // s
  topology::ToolPose pose;
  Vector3 force = Vector3::Zero();  // N, of the organ on the tool
  topology::SurfaceContact contact; // deepest point on the surface at rest
  double contact_radius = 0;        // m
  int active_nodes = 0, candidates = 0, nodes = 0;
  int iterations = 0;
  bool converged = true;
  double residual = 0;            // largest unbalanced force / largest force
  double largest_penetration = 0; // m, left over
  double rotation_degrees = 0;    // largest rotation of the tissue
  bool resprinkled = false;       // the fine zone has followed the tool
  double force_jump = 0;          // |force after - before| / |force before| at the re-sprinkle
  double seconds = 0;             // wall clock of the step
};

/// Wall clock of each stage, s, summed over the run.
struct SessionProfile {
  double organ = 0, sprinkle = 0, discretise = 0, condense = 0, press = 0, evaluate = 0;
};

/// The zone of fine nodes about the contact, with every length derived that the scenario leaves out.
struct FineZone {
  solvers::SpacingField spacing; // centre: the contact
  double candidate_radius = 0;   // m
};

class Session {
 public:
  /// Builds and checks organ, motion and fixed regions; sprinkles when the motion touches the organ. Throws InputError.
  explicit Session(
      Scenario scenario, std::function<void(const std::string&)> say = [](const std::string&) {});

  [[nodiscard]] const std::vector<ToolSample>& motion() const { return motion_; }
  /// False: the motion never touches the organ and every step is free of force.
  [[nodiscard]] bool touches() const { return touch_.has_value(); }

  /// Moves the tool to a sample of motion() and solves. Throws NumericalError.
  StepResult step(const ToolSample& sample);

  [[nodiscard]] const Scenario& scenario() const { return scenario_; }
  [[nodiscard]] const Organ& organ() const { return organ_; }
  [[nodiscard]] const solvers::Sprinkling& sprinkling() const { return sprinkling_; }
  [[nodiscard]] const FineZone& zone() const { return zone_; }
  /// Null before the first step that needs it.
  [[nodiscard]] const solvers::Discretisation* body() const { return body_.get(); }
  /// Solution of the last step.
  [[nodiscard]] const solvers::Field& field() const { return field_; }
  /// Displacement, gradient and stress at every node in the last step.
  [[nodiscard]] const std::vector<solvers::PointState>& node_states() const { return node_states_; }
  [[nodiscard]] const SessionProfile& profile() const { return profile_; }
  /// Said once each: stretched linear elasticity, jumps at re-sprinkles, contact that did not converge.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  [[nodiscard]] topology::SurfaceContact find_contact(const topology::ToolPose& pose) const;
  [[nodiscard]] topology::SurfaceContact centre_of(const topology::SurfaceContact& contact,
                                                   const topology::ToolPose& pose) const;
  [[nodiscard]] bool must_follow(const topology::SurfaceContact& contact) const;
  [[nodiscard]] solvers::SprinkleOptions sprinkle_options(const topology::SurfaceContact& contact) const;
  [[nodiscard]] std::vector<solvers::Prescribed> fixed_nodes() const;
  [[nodiscard]] std::vector<int> candidates() const;
  void sprinkle(const topology::SurfaceContact& contact);
  void build();
  void condense(const std::vector<int>& candidates);
  void press(const topology::ToolPose& pose);
  [[nodiscard]] std::vector<int> penetrated_outside_patch(const topology::ToolPose& pose) const;
  void evaluate(StepResult& result);
  void warn(const std::string& key, const std::string& text);

  Scenario scenario_;
  std::function<void(const std::string&)> say_;
  SessionProfile profile_;
  Organ organ_;
  topology::ContactQuery query_;
  std::vector<ToolSample> motion_;
  std::optional<FirstTouch> touch_;
  FineZone zone_;
  topology::SurfaceContact zone_contact_; // its centre
  solvers::Sprinkling sprinkling_;
  std::unique_ptr<solvers::Discretisation> body_;
  solvers::ContactPatch patch_;
  std::optional<solvers::ContactState> state_;
  std::optional<topology::SurfaceContact> last_contact_;
  solvers::Field field_;
  std::vector<solvers::PointState> node_states_;
  std::vector<std::string> warnings_;
  std::vector<std::string> warned_;
};

} // namespace spherecut::app
