#include "topology/tool/tool_outline.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/overloaded.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::topology {

namespace {

/// m, of the middle of the tip behind the reference point.
double middle_of_tip(const ToolShape& tool) {
  return std::visit(Overloaded{[](const FlatPunch& punch) { return 0.5 * std::min(punch.radius, punch.length); },
                               [](const SphereTip& tip) { return tip.radius; },
                               [](const Laparoscope& scope) { return scope.tip_radius; }},
                    tool);
}

} // namespace

// The section is star-shaped about the place in the plane nearest to the middle of the tip: rays from there leave it
// once.
std::vector<std::array<double, 2>> tool_outline(const ToolShape& tool, const ToolPose& pose, const Vector3& origin,
                                                const Vector3& e1, const Vector3& e2, double reach) {
  if (!std::isfinite(reach) || reach <= 0)
    throw InputError(fmt::format("tool: reach of the outline is {} m, it must be greater than 0 and finite", reach));
  constexpr int rays = 2880, halvings = 60;
  const Vector3 offset = pose.point + middle_of_tip(tool) * pose.axis - origin;
  const Vector3 middle = origin + offset.dot(e1) * e1 + offset.dot(e2) * e2;
  std::vector<std::array<double, 2>> outline;
  if (tool_distance(tool, pose, middle) >= 0)
    return outline;
  const double farthest = reach + (middle - origin).norm(), shortest_step = 1e-4 * tip_radius(tool);
  const double nowhere = std::nan("");
  for (int k = 0; k <= rays; ++k) {
    const double angle = 2 * std::numbers::pi * (k % rays) / rays;
    const Vector3 ray = std::cos(angle) * e1 + std::sin(angle) * e2;
    double inside = 0, outside = 0;
    while (outside <= farthest) {
      const double depth = -tool_distance(tool, pose, middle + outside * ray);
      if (depth <= 0)
        break;
      inside = outside;
      outside += std::max(depth, shortest_step);
    }
    for (int i = 0; i < halvings && outside <= farthest; ++i) {
      const double half = 0.5 * (inside + outside);
      (tool_distance(tool, pose, middle + half * ray) < 0 ? inside : outside) = half;
    }
    const Vector3 from_origin = middle + outside * ray - origin;
    if (from_origin.norm() <= reach)
      outline.push_back({from_origin.dot(e1), from_origin.dot(e2)});
    else if (!outline.empty() && std::isfinite(outline.back()[0]))
      outline.push_back({nowhere, nowhere});
  }
  return outline;
}

} // namespace spherecut::topology
