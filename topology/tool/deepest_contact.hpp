// The deepest contact of a tool with a surface, given something that answers three questions about the surface. Both
// the walk and the FCL query answer them, so both share the definition of depth in SurfaceContact.
//
// A `Surface` has
//   const SurfaceWalk& walk                            the flat arrays;
//   WalkPoint nearest(x, expected, hint, enough)    as SurfaceWalk::nearest; `expected`: a guess of the distance;
//   NearestToSegment nearest_to_segment(start, end, within, hint);
//   LastCrossing last_crossing(start, end).
#pragma once

#include "topology/surface/walk.hpp"
#include "topology/tool/contact.hpp"

#include <cmath>
#include <numbers>

namespace spherecut::topology {

struct Deepest {
  WalkPoint surface; // nearest to tool_point
  Vector3 tool_point = Vector3::Zero();
  double depth = 0; // m
};

/// Deepest point of the segment start + s direction (unit), 0 <= s <= length, below the surface, provided that it is
/// deeper than `best` (else best is returned). Nearest surface points are given at both ends. Some part of the segment
/// must lie inside, and `best` be at least `radius` deep: a maximum outside the body is not looked for.
///
/// The distance to one triangle is convex along the segment, hence below its chord over any interval, and the distance
/// to the surface is below that of any triangle. The chords of the triangles nearest to the two ends bound the depth in
/// between, sharply where the triangles act as planes; so does the unit slope of any distance. The interval of the
/// highest bound is cut where its two chords meet, until no bound beats the best.
template <class Surface>
Deepest deepest_inside(const Surface& surface, const Vector3& start, const Vector3& direction, double length,
                       double radius, const WalkPoint& at_start, const WalkPoint& at_end, Deepest best) {
  struct End {
    double along, depth; // m; depth without radius
    int triangle;
  };
  struct Interval {
    End from, to;
    double cut, bound; // m along the segment; m of depth
  };
  constexpr double tolerance = 1e-11; // m
  constexpr int most_queries = 300;   // a bound on time; tens are usual
  std::array<Interval, most_queries + 1> open;
  int count = 0;
  const auto push = [&](const End& from, const End& to) {
    const double width = to.along - from.along;
    const double left0 = std::abs(from.depth), right1 = std::abs(to.depth);
    const double left1 = surface.walk.distance_to_triangle(start + to.along * direction, from.triangle);
    const double right0 = surface.walk.distance_to_triangle(start + from.along * direction, to.triangle);
    const double rise = (left1 - left0) + (right0 - right1);
    const double meet = rise > 0 ? std::clamp((right0 - left0) / rise, 0.0, 1.0) : 0.5;
    const double chords = std::max({left0, right1, std::lerp(left0, left1, meet)});
    const double bound = std::min(chords, 0.5 * (from.depth + to.depth + width));
    if (bound + radius > best.depth + tolerance && width > 1e-12)
      open[count++] = {from, to, from.along + std::clamp(meet, 0.02, 0.98) * width, bound};
  };
  push({0, -at_start.signed_distance, at_start.triangle}, {length, -at_end.signed_distance, at_end.triangle});
  for (int queries = 0; count > 0 && queries < most_queries; ++queries) {
    const auto highest = std::max_element(open.begin(), open.begin() + count,
                                          [](const Interval& a, const Interval& b) { return a.bound < b.bound; });
    const Interval i = *highest;
    if (!(i.bound + radius > best.depth + tolerance))
      break;
    *highest = open[--count];
    const Vector3 x = start + i.cut * direction;
    const bool nearer_from = i.cut - i.from.along < i.to.along - i.cut;
    const WalkPoint nearest = surface.nearest(x, i.bound, nearer_from ? i.from.triangle : i.to.triangle, 0.0);
    const double depth = -nearest.signed_distance;
    if (depth + radius > best.depth)
      best = {nearest, x, depth + radius};
    push(i.from, {i.cut, depth, nearest.triangle});
    push({i.cut, depth, nearest.triangle}, i.to);
  }
  return best;
}

template <class Surface>
Deepest deepest_of_sphere(const Surface& surface, const SphereTip& tip, const ToolPose& pose, int hint) {
  const Vector3 centre = pose.point + tip.radius * pose.axis;
  const WalkPoint nearest = surface.nearest(centre, tip.radius, hint, 0.0);
  return {nearest, centre, tip.radius - nearest.signed_distance};
}

template <class Surface>
Deepest deepest_of_laparoscope(const Surface& surface, const Laparoscope& scope, const ToolPose& pose,
                               const SurfaceContact& last) {
  const int hint = surface.walk.internal(last.triangle);
  const Vector3 centre = pose.point + scope.tip_radius * pose.axis;
  const WalkPoint at_tip = surface.nearest(centre, scope.tip_radius, hint, 0.0);
  Deepest best{at_tip, centre, scope.tip_radius - at_tip.signed_distance};

  const double length = scope.shaft_length;
  const Vector3 end = centre + length * pose.axis;
  const LastCrossing crossing = surface.last_crossing(centre, end);
  const bool end_inside = crossing.triangle < 0 ? at_tip.signed_distance < 0 : !crossing.leaves;
  if (crossing.triangle >= 0 || end_inside) {
    // The part that may be inside ends at the last crossing, or with the axis.
    const double reach = end_inside ? length : crossing.along * length;
    const Vector3 x = centre + reach * pose.axis;
    const std::array<int, 1> crossed{std::max(crossing.triangle, 0)};
    const WalkPoint at_reach =
        end_inside ? surface.nearest(x, length, hint, 0.0) : surface.walk.nearest_among(x, crossed);
    if (scope.shaft_radius - at_reach.signed_distance > best.depth)
      best = {at_reach, x, scope.shaft_radius - at_reach.signed_distance};
    return deepest_inside(surface, centre, pose.axis, reach, scope.shaft_radius, at_tip, at_reach, best);
  }
  // The axis lies outside: the shaft is deeper than the tip where the surface is nearer to the axis than this.
  const double within = scope.shaft_radius - best.depth;
  if (within > 0) {
    const NearestToSegment nearest = surface.nearest_to_segment(centre, end, within, hint);
    if (nearest.triangle >= 0) {
      const Vector3 x = centre + nearest.along * length * pose.axis;
      const std::array<int, 1> one{nearest.triangle};
      const WalkPoint at = surface.walk.nearest_among(x, one);
      best = {at, x, scope.shaft_radius - std::abs(at.signed_distance)};
    }
  }
  return best;
}

template <class Surface>
Deepest deepest_of_punch(const Surface& surface, const FlatPunch& punch, const ToolPose& pose,
                         const SurfaceContact& last, std::array<int, 10>& end_triangles) {
  const auto hint = [&](int i) { return surface.walk.internal(end_triangles[i]); };
  const WalkPoint at_centre = surface.nearest(pose.point, punch.radius, hint(9), 0.0);
  Deepest best{at_centre, pose.point, -at_centre.signed_distance};
  end_triangles[9] = surface.walk.original(at_centre.triangle);

  // Down the slope within the flat end; any direction when the end is parallel to the surface.
  const Vector3 normal = surface.walk.smooth_normal(at_centre);
  Vector3 down = pose.axis.dot(normal) * pose.axis - normal;
  if (!(down.squaredNorm() > 1e-24)) {
    Eigen::Index smallest = 0;
    pose.axis.cwiseAbs().minCoeff(&smallest);
    down = pose.axis.cross(Vector3::Unit(smallest));
  }
  down.normalize();
  const Vector3 across = pose.axis.cross(down);

  constexpr double d = 1 / std::numbers::sqrt2;
  constexpr std::array<std::array<double, 2>, 9> probes{
      {{1, 0}, {0.5, 0}, {d, d}, {d, -d}, {0, 1}, {0, -1}, {-d, d}, {-d, -d}, {-1, 0}}}; // down, across
  const auto position = [&](int i) {
    return Vector3(pose.point + punch.radius * (probes[i][0] * down + probes[i][1] * across));
  };
  // The probe that was deepest last time comes first: it is likely to refute the others at once. The outcome does not
  // depend on the order but for differences below the margin, which are rounding.
  int first = 0;
  for (int i = 1; i < std::ssize(probes); ++i)
    if ((position(i) - last.tool_point).squaredNorm() < (position(first) - last.tool_point).squaredNorm())
      first = i;
  const double margin = 1e-7 * punch.radius;
  const auto probe = [&](int i) {
    const Vector3 x = position(i);
    // Nearer to the surface than the depth to beat: not deeper, whichever side it is on.
    const double enough = std::max(0.0, best.depth + margin);
    const WalkPoint nearest = surface.nearest(x, punch.radius, hint(i), enough);
    end_triangles[i] = surface.walk.original(nearest.triangle);
    if (-nearest.signed_distance > best.depth + margin)
      best = {nearest, x, -nearest.signed_distance};
  };
  probe(first);
  for (int i = 0; i < std::ssize(probes); ++i)
    if (i != first)
      probe(i);
  return best;
}

/// The contact as SurfaceContact defines it; the search starts from `last`.
template <class Surface>
SurfaceContact deepest_contact(const Surface& surface, const ToolShape& tool, const ToolPose& pose,
                               const SurfaceContact& last) {
  const int hint = surface.walk.internal(last.triangle);
  std::array<int, 10> end_triangles = last.end_triangles;
  // Not std::visit, which may throw as far as a compiler knows.
  static_assert(std::variant_size_v<ToolShape> == 3, "a tool shape without its deepest contact");
  Deepest deepest;
  if (const auto* scope = std::get_if<Laparoscope>(&tool))
    deepest = deepest_of_laparoscope(surface, *scope, pose, last);
  else if (const auto* punch = std::get_if<FlatPunch>(&tool))
    deepest = deepest_of_punch(surface, *punch, pose, last, end_triangles);
  else if (const auto* tip = std::get_if<SphereTip>(&tool))
    deepest = deepest_of_sphere(surface, *tip, pose, hint);
  return {deepest.surface.point, deepest.surface.normal, deepest.depth, surface.walk.original(deepest.surface.triangle),
          deepest.tool_point,    end_triangles};
}

} // namespace spherecut::topology
