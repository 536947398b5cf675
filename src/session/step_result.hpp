// What a step of a session gives.
#pragma once

#include "src/session/tear_report.hpp"
#include "src/tissue/cut_report.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// Volume ratio of a body at finite strain below which it is warned of: a confined cube (nu = 0.3) has an equilibrium
/// down to 0.2.
inline constexpr double least_sound_jacobian = 0.3;

/// Wall clock of the stages of a step, s.
struct StageSeconds {
  double contact = 0; // where the tool is on the surface at rest
  double cut = 0;     // what the blade cuts, the body with that cut included
  double body = 0;    // built, or anew because the tool has gone on; looked at for that
  double solve = 0;   // tool, grasper and lips
  double tear = 0;    // fronts that move, the bodies with their cuts included
  double force = 0;   // what is told of the solution
};

/// Outcome of one step.
struct StepResult {
  double time = 0; // s
  topology::ToolPose pose;
  Vector3 force = Vector3::Zero();      // N, of the organ on the tool
  Vector3 torque = Vector3::Zero();     // N m, of the organ on the tool about its reference point, pose.point
  Vector3 tangential = Vector3::Zero(); // N, the part of it along the surface (solvers::tangential_force)
  topology::SurfaceContact contact;     // deepest point on the surface at rest
  double contact_radius = 0;            // m
  int active_nodes = 0, candidates = 0, nodes = 0;
  int iterations = 0;
  bool converged = true;
  double residual = 0;            // largest unbalanced force / largest force
  double largest_penetration = 0; // m, deepest that the deformed surface lies in the tool
  double self_penetration = 0;    // m, deepest that it reaches through itself, from node to node
  double rotation_degrees = 0;    // largest rotation of the tissue
  double least_jacobian = 1;      // least volume ratio of a body at finite strain
  bool resprinkled = false;       // the fine zone has followed the tool
  double force_jump = 0;          // |force after - before| / |force before| at the re-sprinkle
  Rebuild rebuild = Rebuild::none;
  double seconds = 0;             // wall clock of the step
  StageSeconds stages;            // likewise, of its stages
  std::optional<CutReport> cut;   // in a scenario that cuts
  std::optional<TearReport> tear; // in one that tears, from the first solution on

  /// How the system came to the cut of this step: that of the blade or, if it has cut nothing, of the last increment of
  /// a tear.
  [[nodiscard]] SystemUpdate update() const {
    const SystemUpdate by_blade = cut ? cut->update : SystemUpdate::none;
    return by_blade != SystemUpdate::none || !tear ? by_blade : tear->increments.back().body.update;
  }
  /// Whether the body that it came to has grown, in the step or beside it.
  [[nodiscard]] bool has_grown() const {
    const bool by_blade = cut && cut->update != SystemUpdate::none;
    return by_blade ? cut->has_grown : tear && tear->increments.back().body.has_grown;
  }
};

} // namespace spherecut::app
