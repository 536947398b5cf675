// Motions of a ball on a block, and the errors of the force models on them: ground of the haptic experiments.
#pragma once

#include "src/live/haptic_report.hpp"

#include <string>
#include <vector>

namespace spherecut::experiments {

/// A motion of the tool, with or without a blade that cuts beside it.
struct HapticMotion {
  std::string name;
  double duration = 1;             // s
  std::vector<app::PathPose> path; // of the ball's lowest point
  bool cut = false;
  double friction = 0; // coefficient; 0: the ball slides freely
};

/// press: 4 mm deep in 0.4 s and out. tap: three times in and out of contact at 0.1 m/s. slide: 3 mm deep, 16 mm along
/// the surface at up to 50 mm/s. drag: the same with a coefficient of friction of 0.3. sine: 1 to 5 Hz about 3.5 mm of
/// depth, up to 0.1 m/s. cut: 4 Hz about 2.5 mm of depth while a blade cuts into a side of the block at 10 mm/s; it is
/// the first.
std::vector<HapticMotion> haptic_motions();

/// A ball of 10 mm radius on a block of 60 x 60 x 30 mm with E = 10 kPa on its base, about 300 nodes; nu = 0.3.
app::Scenario haptic_block(const HapticMotion& motion, solvers::Method method);

/// A motion and the force solved at every tick of it.
struct SolvedMotion {
  solvers::Method method;
  HapticMotion motion;
  std::vector<app::SolvedForce> solved; // one a tick
  double peak = 0;                      // N
};
SolvedMotion solve_motion(solvers::Method method, const HapticMotion& motion);

/// The loop in virtual time on the motion, without device limits or controller: `solve_rate` solves a second, each of
/// which takes the whole time until the next.
std::vector<app::LoopRecords> run_motion(const SolvedMotion& motion, const std::vector<app::ForceModelKind>& models,
                                         int solve_rate);

} // namespace spherecut::experiments
