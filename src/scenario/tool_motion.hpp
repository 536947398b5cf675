// The way of the tool as poses at the steps of a run.
#pragma once

#include "src/scenario/scenario.hpp"
#include "topology/tool/contact.hpp"

namespace spherecut::app {

struct ToolSample {
  double time = 0; // s
  topology::ToolPose pose;
};

/// Ascending `times`, every `step`, with those of `corners` that are not among them: no corner of a way is cut off.
std::vector<double> with_corners(std::vector<double> times, const std::vector<double>& corners, double step);

/// Poses from the start to the end of the motion, every ToolSettings::step seconds (0: 20 steps) and at every pose of
/// its path. An approach is placed by its first touch of the surface; when its line misses the organ it runs past the
/// target instead. The surface, within `bounds`, is that at rest or that of the body as its loads have moved it. Throws
/// InputError, with the key, when the tool touches or is inside the organ at the start.
std::vector<ToolSample> tool_motion(const ToolSettings& tool, const topology::ContactQuery& organ,
                                    const BoundingBox& bounds);

/// The first contact on the motion: where the tool begins to touch the surface at rest, between two samples found by
/// bisection to 1e-7 m. Empty when it never does.
struct FirstTouch {
  topology::SurfaceContact contact;
  topology::ToolPose pose;
  std::size_t sample = 0; // first sample that touches
};
std::optional<FirstTouch> first_touch(const ToolSettings& tool, const std::vector<ToolSample>& motion,
                                      const topology::ContactQuery& organ);

/// Where a motion that never touches comes nearest. Its contact's depth is negative.
std::optional<FirstTouch> nearest_approach(const ToolSettings& tool, const std::vector<ToolSample>& motion,
                                           const topology::ContactQuery& organ);

} // namespace spherecut::app
