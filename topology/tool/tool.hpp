// Rigid surgical tools as implicit shapes in their own frame, and their pose.
#pragma once

#include "topology/surface/mesh.hpp"

#include <Eigen/Geometry>
#include <variant>

namespace spherecut::topology {

/// Spherical tip: the reference point of the tool is its lowest point along the tool axis (see ToolPose), its centre is
/// point + radius * axis.
struct SphereTip {
  double radius = 0.005; // m
};

/// Flat cylindrical punch: reference point at the centre of its flat end; the body extends `length` along +axis.
struct FlatPunch {
  double radius = 0.005; // m
  double length = 0.05;  // m
};

/// Laparoscopic instrument: the union of a spherical tip and a shaft capsule whose axis starts at the tip centre,
/// pivoting on a port in the abdominal wall. The reference point is the extreme point of the tip; the axis points from
/// there to the port, the tip centre is point + tip_radius * axis.
struct Laparoscope {
  double tip_radius = 0.004;      // m
  double shaft_radius = 0.0025;   // m, at most tip_radius
  double shaft_length = 0.30;     // m, from the tip centre backwards
  Vector3 port = Vector3::Zero(); // m, world frame
};

using ToolShape = std::variant<SphereTip, FlatPunch, Laparoscope>;

/// Where a tool is: its reference point and the unit vector from the reference point into the tool (away from tissue).
struct ToolPose {
  Vector3 point = Vector3::Zero();
  Vector3 axis = Vector3::UnitZ();
};

/// Pose of a tool whose reference point is at `point`; a Laparoscope takes its axis from its port, others the given one
/// (any length). Throws InputError when the point coincides with the port, the axis is zero, or either is not finite.
ToolPose pose_at(const ToolShape& tool, const Vector3& point, const Vector3& axis = Vector3::UnitZ());

/// Signed distance from x to the tool's surface, m, negative inside the tool. Exact, except inside a Laparoscope where
/// tip and shaft overlap: there it is the smaller of the two parts' distances (exact in sign and at the surface).
double tool_distance(const ToolShape& tool, const ToolPose& pose, const Vector3& x);

/// Unit gradient of tool_distance at x: outward normal of the tool. Where several directions are equally steep (centre
/// of a ball, an axis) one of them, always the same.
Vector3 tool_normal(const ToolShape& tool, const ToolPose& pose, const Vector3& x);

/// Both at once.
struct DistanceAndNormal {
  double distance; // m
  Vector3 normal;
};
DistanceAndNormal tool_distance_and_normal(const ToolShape& tool, const ToolPose& pose, const Vector3& x);

/// Radius of the part that touches first, m: of the ball, of the flat end, of the instrument's tip.
double tip_radius(const ToolShape& tool);

/// Throws InputError on non-positive or non-finite sizes, a port that is not finite, a shaft thicker than its tip.
void check(const ToolShape& tool);
/// Throws InputError on a pose that is not finite or whose axis is not a unit vector.
void check(const ToolPose& pose);

/// Closed outward surface of the tool for viewers, edges of about `edge` m (never fewer than 12 nor more than 720
/// around or along a part). Its vertices lie on the tool. Throws InputError when edge is not positive.
SurfaceMesh tool_mesh(const ToolShape& tool, const ToolPose& pose, double edge);

} // namespace spherecut::topology
