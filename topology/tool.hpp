// Rigid surgical tools as implicit shapes in their own frame, and their pose.
#pragma once

#include "topology/types.hpp"

#include <Eigen/Geometry>
#include <variant>

namespace spherecut::topology {

/// Spherical tip: the reference point of the tool is its lowest point along the tool axis (see ToolPose).
struct SphereTip {
  double radius = 0.005; // m
};

/// Flat cylindrical punch: reference point at the centre of its flat end; the body extends `length` along +axis.
struct FlatPunch {
  double radius = 0.005; // m
  double length = 0.05;  // m
};

/// Laparoscopic instrument: a shaft capsule with a spherical tip, pivoting on a port in the abdominal wall. The
/// reference point is the extreme point of the tip; the axis always passes through the port.
struct Laparoscope {
  double tip_radius = 0.004;      // m
  double shaft_radius = 0.0025;   // m
  double shaft_length = 0.30;     // m, from the tip centre backwards
  Vector3 port = Vector3::Zero(); // m, world frame
};

using ToolShape = std::variant<SphereTip, FlatPunch, Laparoscope>;

/// Where a tool is: its reference point and the unit vector from the reference point into the tool (away from tissue).
struct ToolPose {
  Vector3 point = Vector3::Zero();
  Vector3 axis = Vector3::UnitZ();
};

/// Pose of a tool whose reference point is at `point`; a Laparoscope takes its axis from its port, others the given
/// one. Throws InputError when the point coincides with the port or the axis is zero.
ToolPose pose_at(const ToolShape& tool, const Vector3& point, const Vector3& axis = Vector3::UnitZ());

/// Signed distance from x to the tool's surface, m, negative inside the tool.
double tool_distance(const ToolShape& tool, const ToolPose& pose, const Vector3& x);

/// Unit gradient of tool_distance at x: outward normal of the tool.
Vector3 tool_normal(const ToolShape& tool, const ToolPose& pose, const Vector3& x);

/// Radius of the part that touches first, m.
double tip_radius(const ToolShape& tool);

/// Throws InputError on non-positive or non-finite sizes.
void check(const ToolShape& tool);

} // namespace spherecut::topology
