// One run: the organ, its nodes about contact and cuts, the tool pressed into it and the blade drawn through it, step
// by step. A step reads like the paper: contact, sprinkle, supports and collocation, solve, force [De 2001, sections 2
// and 3]. A cut goes before it: blade at rest, incision, wound, sprinkle, assemble.
#pragma once

#include "src/session/step_result.hpp"

namespace spherecut::app {

/// Bodies that the next steps wait for, or take over.
struct PendingBody {
  bool under_way = false; // one is made in the background
  bool there = false;     // it is finished
  bool put_off = false;   // a cut is, that the next step would make if the blade rested
  bool lags = false;      // the blade has gone where the body has not followed it yet
};

class Session {
 public:
  /// Builds and checks organ, motion, precuts and fixed regions; sprinkles when something touches or cuts the organ, or
  /// may do so in a device's hand. Throws InputError.
  explicit Session(
      Scenario scenario, std::function<void(const std::string&)> say = [](const std::string&) {},
      Leader leader = Leader::path);
  ~Session();

  [[nodiscard]] const std::vector<StepSample>& steps() const;
  /// False: there is no tool, or its path leads it and never touches the organ: every step is free of its force.
  [[nodiscard]] bool touches() const;
  /// Whether there is anything to compute: else every step leaves the organ at rest.
  [[nodiscard]] bool computes() const;
  /// Whether a grasper holds the tissue: its patch is bonded to it.
  [[nodiscard]] bool grasps() const;

  /// Goes on to a step of steps(), in their order: cuts, moves the tool, solves, tears. `passed`: poses of the blade
  /// since the last step, in order, through which its way leads. A cut or an increment of a tear that is refused leaves
  /// everything as it was, and says why in the result and once in warnings(). Throws NumericalError, and InputError
  /// when a grasper cannot reach the tissue.
  StepResult step(const StepSample& sample, std::vector<topology::BladePose> passed = {});

  /// Builds the body and condenses it onto the tool's candidates before the first touch, so that the first step in
  /// contact need not. `sample`: where the tool is. Does nothing when there is nothing to compute.
  void prepare(const StepSample& sample);

  /// Where the blade was in the last step that had one.
  [[nodiscard]] const std::optional<topology::BladePose>& last_blade() const;
  /// The blade leaves the tissue where it is, and the next step that has one only places it: its way does not cut in
  /// between. From now on its way is not taken to be the scenario's: nodes are fine at the front of the cut.
  void lift_blade();

  [[nodiscard]] const SessionOptions& options() const;
  /// What is made in the background and is not wanted any more is dropped, or taken over where it has followed a cut.
  void set_options(const SessionOptions& options);

  [[nodiscard]] PendingBody pending() const;
  /// Takes over the body that is under way, after waiting for it where need be; the next step solves with it. False:
  /// there is none, or its cut is refused. Throws what making nodes and body anew throws.
  bool swap_body();

  /// Spacings `factor` times the scenario's from the next sprinkling on. Throws InputError unless it is positive.
  void coarsen(double factor);

  [[nodiscard]] const Scenario& scenario() const;
  [[nodiscard]] const Organ& organ() const;
  [[nodiscard]] const OrganWalls& walls() const;
  [[nodiscard]] const FineZone& zone() const;
  /// Nodes, cut, body (null before the first step that needs it, and where the law is not linear), condensed patch,
  /// contact and solution of the last step.
  [[nodiscard]] const BodyModel& model() const;
  /// What the blade feels; null: nothing resists it.
  [[nodiscard]] const BladeForce* blade() const;
  /// The surface with the cut so far; null in a scenario without cuts.
  [[nodiscard]] const topology::Wound* wound() const;
  /// Displacement, gradient and stress at every node in the last step.
  [[nodiscard]] const std::vector<solvers::PointState>& node_states() const;
  [[nodiscard]] const SessionProfile& profile() const;
  /// Said once each: stretched linear elasticity, jumps at re-sprinkles, contact that did not converge, refused cuts.
  [[nodiscard]] const std::vector<std::string>& warnings() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

} // namespace spherecut::app
