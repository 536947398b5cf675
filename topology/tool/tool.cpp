#include "topology/tool/tool.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/overloaded.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::topology {
namespace {

/// Some unit vector perpendicular to the axis, always the same one for the same axis.
Vector3 perpendicular(const Vector3& axis) {
  Eigen::Index smallest = 0;
  axis.cwiseAbs().minCoeff(&smallest);
  return axis.cross(Vector3::Unit(smallest)).normalized();
}

DistanceAndNormal ball(const Vector3& centre, double radius, const Vector3& axis, const Vector3& x) {
  const Vector3 out = x - centre;
  const double length = out.norm();
  return {length - radius, length > 0 ? Vector3(out / length) : Vector3(-axis)};
}

DistanceAndNormal capsule(const Vector3& start, const Vector3& axis, double length, double radius, const Vector3& x) {
  const double along = std::clamp(axis.dot(x - start), 0.0, length);
  const Vector3 out = x - (start + along * axis);
  const double distance = out.norm();
  return {distance - radius, distance > 0 ? Vector3(out / distance) : perpendicular(axis)};
}

/// Solid cylinder from z = 0 to z = length along the axis, seen in the half-plane (rho, z) of x.
DistanceAndNormal cylinder(const Vector3& base, const Vector3& axis, double length, double radius, const Vector3& x) {
  const double z = axis.dot(x - base);
  const Vector3 radial = x - base - z * axis;
  const double rho = radial.norm();
  const Vector3 sideways = rho > 0 ? Vector3(radial / rho) : perpendicular(axis);
  const Vector3 endways = z < 0.5 * length ? Vector3(-axis) : axis;
  const double beyond_side = rho - radius, beyond_end = std::max(-z, z - length);
  if (beyond_side > 0 && beyond_end > 0) {
    const double distance = std::hypot(beyond_side, beyond_end);
    return {distance, (beyond_side * sideways + beyond_end * endways) / distance};
  }
  return beyond_side > beyond_end ? DistanceAndNormal{beyond_side, sideways} : DistanceAndNormal{beyond_end, endways};
}

void require_positive(const char* field, double value) {
  if (!std::isfinite(value) || value <= 0)
    throw InputError(fmt::format("tool: {} is {} m, it must be greater than 0 and finite", field, value));
}

void require_finite(const char* field, const Vector3& value) {
  if (!value.allFinite())
    throw InputError(
        fmt::format("tool: {} is ({}, {}, {}), it must be finite", field, value.x(), value.y(), value.z()));
}

/// A point of the profile that the surface of revolution sweeps, m.
struct ProfilePoint {
  double z, rho;
};

int pieces(double length, double edge) {
  return static_cast<int>(std::clamp(std::ceil(length / edge), 1.0, 720.0));
}

/// Straight piece from the last point of the profile to `end`.
void add_line(std::vector<ProfilePoint>& profile, ProfilePoint end, double edge) {
  const ProfilePoint start = profile.back();
  const int n = pieces(std::hypot(end.z - start.z, end.rho - start.rho), edge);
  for (int i = 1; i <= n; ++i)
    profile.push_back({std::lerp(start.z, end.z, double(i) / n), std::lerp(start.rho, end.rho, double(i) / n)});
}

/// Arc about (centre, 0), angles measured from -z, without its first point.
void add_arc(std::vector<ProfilePoint>& profile, double centre, double radius, double from, double to, double edge) {
  const int n = std::max(pieces(radius * (to - from), edge), static_cast<int>(std::ceil(6 * (to - from))));
  for (int i = 1; i <= n; ++i) {
    const double angle = std::lerp(from, to, double(i) / n);
    profile.push_back({centre - radius * std::cos(angle), radius * std::sin(angle)});
  }
}

/// Profile from the reference end (z = 0, rho = 0) to the far pole.
std::vector<ProfilePoint> profile_of(const ToolShape& tool, double edge) {
  constexpr double pi = std::numbers::pi;
  std::vector<ProfilePoint> profile{{0, 0}};
  const Overloaded by_shape{[&](const SphereTip& tip) { add_arc(profile, tip.radius, tip.radius, 0, pi, edge); },
                            [&](const FlatPunch& punch) {
                              add_line(profile, {0, punch.radius}, edge);
                              add_line(profile, {punch.length, punch.radius}, edge);
                              add_line(profile, {punch.length, 0}, edge);
                            },
                            [&](const Laparoscope& scope) {
                              const double r = scope.tip_radius, shaft = scope.shaft_radius;
                              const double end = r + scope.shaft_length;
                              if (end + shaft <= 2 * r) { // the tip swallows the whole shaft
                                add_arc(profile, r, r, 0, pi, edge);
                                return;
                              }
                              const double cylinder_leaves_tip = r + std::sqrt(r * r - shaft * shaft);
                              if (cylinder_leaves_tip < end) {
                                add_arc(profile, r, r, 0, pi - std::asin(shaft / r), edge);
                                add_line(profile, {end, shaft}, edge);
                                add_arc(profile, end, shaft, pi / 2, pi, edge);
                                return;
                              }
                              // A shaft so short that only its far cap emerges: where the two circles meet.
                              const double length = scope.shaft_length;
                              const double z = r + (length * length + r * r - shaft * shaft) / (2 * length);
                              const double rho = std::sqrt(std::max(0.0, r * r - (z - r) * (z - r)));
                              add_arc(profile, r, r, 0, std::atan2(rho, r - z), edge);
                              add_arc(profile, end, shaft, std::atan2(rho, end - z), pi, edge);
                            }};
  std::visit(by_shape, tool);
  profile.back().rho = 0;
  return profile;
}

} // namespace

ToolPose pose_at(const ToolShape& tool, const Vector3& point, const Vector3& axis) {
  require_finite("reference point", point);
  const auto* scope = std::get_if<Laparoscope>(&tool);
  const Vector3 direction = scope ? Vector3(scope->port - point) : axis;
  require_finite(scope ? "port" : "axis", direction);
  const double length = direction.stableNorm();
  constexpr double shortest = 1e-9;
  if (scope && length < shortest)
    throw InputError(fmt::format("tool: reference point ({}, {}, {}) lies {} m from the port, at least {} m is needed",
                                 point.x(), point.y(), point.z(), length, shortest));
  if (length <= 0)
    throw InputError("tool: axis is (0, 0, 0), its length must be greater than 0");
  return {point, direction.stableNormalized()};
}

DistanceAndNormal tool_distance_and_normal(const ToolShape& tool, const ToolPose& pose, const Vector3& x) {
  const Overloaded by_shape{
      [&](const SphereTip& tip) { return ball(pose.point + tip.radius * pose.axis, tip.radius, pose.axis, x); },
      [&](const FlatPunch& punch) { return cylinder(pose.point, pose.axis, punch.length, punch.radius, x); },
      [&](const Laparoscope& scope) {
        const Vector3 centre = pose.point + scope.tip_radius * pose.axis;
        const DistanceAndNormal tip = ball(centre, scope.tip_radius, pose.axis, x);
        const DistanceAndNormal shaft = capsule(centre, pose.axis, scope.shaft_length, scope.shaft_radius, x);
        return shaft.distance < tip.distance ? shaft : tip;
      }};
  return std::visit(by_shape, tool);
}

double tool_distance(const ToolShape& tool, const ToolPose& pose, const Vector3& x) {
  return tool_distance_and_normal(tool, pose, x).distance;
}

Vector3 tool_normal(const ToolShape& tool, const ToolPose& pose, const Vector3& x) {
  return tool_distance_and_normal(tool, pose, x).normal;
}

double tip_radius(const ToolShape& tool) {
  const Overloaded by_shape{[](const SphereTip& tip) { return tip.radius; },
                            [](const FlatPunch& punch) { return punch.radius; },
                            [](const Laparoscope& scope) { return scope.tip_radius; }};
  return std::visit(by_shape, tool);
}

void check(const ToolShape& tool) {
  const Overloaded by_shape{[](const SphereTip& tip) { require_positive("radius", tip.radius); },
                            [](const FlatPunch& punch) {
                              require_positive("radius", punch.radius);
                              require_positive("length", punch.length);
                            },
                            [](const Laparoscope& scope) {
                              require_positive("tip_radius", scope.tip_radius);
                              require_positive("shaft_radius", scope.shaft_radius);
                              require_positive("shaft_length", scope.shaft_length);
                              require_finite("port", scope.port);
                              if (scope.shaft_radius > scope.tip_radius)
                                throw InputError(
                                    fmt::format("tool: shaft_radius is {} m, it must not exceed tip_radius, {} m",
                                                scope.shaft_radius, scope.tip_radius));
                            }};
  std::visit(by_shape, tool);
}

void check(const ToolPose& pose) {
  constexpr double rounding = 1e-6;
  require_finite("reference point", pose.point);
  require_finite("axis", pose.axis);
  if (const double length = pose.axis.norm(); std::abs(length - 1) > rounding)
    throw InputError(fmt::format("tool: axis ({}, {}, {}) has the length {}, it must be 1", pose.axis.x(),
                                 pose.axis.y(), pose.axis.z(), length));
}

SurfaceMesh tool_mesh(const ToolShape& tool, const ToolPose& pose, double edge) {
  check(tool);
  require_positive("edge of the mesh", edge);
  const std::vector<ProfilePoint> profile = profile_of(tool, edge);
  double widest = 0;
  for (const ProfilePoint& p : profile)
    widest = std::max(widest, p.rho);
  const int sectors = std::max(12, pieces(2 * std::numbers::pi * widest, edge));
  const int rings = static_cast<int>(profile.size()) - 2;

  SurfaceMesh mesh;
  const Vector3 e1 = perpendicular(pose.axis), e2 = pose.axis.cross(e1);
  mesh.vertices.push_back(pose.point);
  for (int i = 1; i <= rings; ++i)
    for (int j = 0; j < sectors; ++j) {
      const double angle = 2 * std::numbers::pi * j / sectors;
      mesh.vertices.push_back(pose.point + profile[i].z * pose.axis +
                              profile[i].rho * (std::cos(angle) * e1 + std::sin(angle) * e2));
    }
  mesh.vertices.push_back(pose.point + profile.back().z * pose.axis);

  const int far_pole = static_cast<int>(mesh.vertices.size()) - 1;
  const auto vertex = [&](int ring, int sector) { return 1 + (ring - 1) * sectors + sector % sectors; };
  for (int j = 0; j < sectors; ++j) {
    mesh.triangles.push_back({0, vertex(1, j + 1), vertex(1, j)});
    for (int i = 1; i < rings; ++i) {
      mesh.triangles.push_back({vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1)});
      mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i + 1, j)});
    }
    mesh.triangles.push_back({far_pole, vertex(rings, j), vertex(rings, j + 1)});
  }
  return mesh;
}

} // namespace spherecut::topology
