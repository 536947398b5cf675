// The moments of a run: where tool and blade are at each.
#pragma once

#include "src/scenario/tool_motion.hpp"
#include "topology/blade/blade.hpp"

namespace spherecut::app {

/// One moment of a run.
struct StepSample {
  double time = 0;                          // s
  std::optional<topology::ToolPose> tool;   // empty: no tool in this scenario
  std::optional<topology::BladePose> blade; // empty: no blade, or not on its way at this time
};

/// Pose of a blade on its path, between two poses evenly moved and turned; empty outside its times.
std::optional<topology::BladePose> blade_pose(const BladeSettings& blade, double time);

/// Farthest way of a point of the edge between two poses, m.
double edge_travel(const std::vector<Vector3>& edge, const topology::BladePose& a, const topology::BladePose& b);

/// On the straight way from one pose to the other; `share` 0 to 1.
topology::BladePose pose_between(const topology::BladePose& from, const topology::BladePose& to, double share);

/// The poses of a way that begins at `from`, without those past which it goes straight on: the edge then passes within
/// `tolerance` m of where it was at each of them. The last one stays.
std::vector<topology::BladePose> without_straight(const std::vector<Vector3>& edge, const topology::BladePose& from,
                                                  const std::vector<topology::BladePose>& way, double tolerance);

/// Of the cutting edge, m.
double edge_length(const BladeSettings& blade);

/// Largest way of a point of the edge from one pose of the path to the next, summed, m.
double blade_travel(const BladeSettings& blade);

/// The moments of the tool's motion and of the blade's path together, in order; one at time 0 when there is neither.
/// Before and after its own motion the tool stays where that starts and ends; in between it moves evenly from sample to
/// sample. Without a time step of its own the blade's edge moves by `blade_stride` m in a step. Throws InputError
/// naming file and line when that makes more increments than `most_triangles` triangles of the sheet allow, with
/// columns of `column` m along the edge.
std::vector<StepSample> schedule(const Scenario& scenario, const std::vector<ToolSample>& tool, double blade_stride,
                                 double column, int most_triangles);

/// Lines along the way of the blade's edge, about `apart` m from one another, that come nearer than `apart` to the
/// body: where the cut is expected.
std::vector<std::array<Vector3, 2>> blade_tracks(const BladeSettings& blade, const topology::Domain& domain,
                                                 double apart);

/// How the edge of a blade meets the body at rest, looked at every `apart` m along edge and way, less often far from
/// it.
struct BladeWay {
  double start_depth = 0;                // m, of the deepest place of the edge at the start; 0: it starts outside
  Vector3 start_place = Vector3::Zero(); // m, where that is
  double nearest = 0;                    // m, least distance on the way; 0: it meets the body
};
BladeWay blade_way(const BladeSettings& blade, const topology::Domain& domain, double apart);

} // namespace spherecut::app
