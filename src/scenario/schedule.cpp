#include "src/scenario/schedule.hpp"

#include "src/scenario/cut_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/domain.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::app {
namespace {

constexpr double same_time = 1e-9;   // of the duration of a run
constexpr double track_degrees = 10; // turn of the blade along one straight track

Eigen::Quaterniond orientation(const Vector3& degrees) {
  const double angle = degrees.norm();
  if (angle == 0)
    return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle * std::numbers::pi / 180, degrees / angle));
}

double largest_way(const BladeSettings& blade, const BladePoint& from, const BladePoint& to) {
  const topology::BladePose a{from.time, from.position, orientation(from.rotation)};
  const topology::BladePose b{to.time, to.position, orientation(to.rotation)};
  const double turn = a.orientation.angularDistance(b.orientation);
  double largest = 0;
  for (const Vector3& point : blade.edge)
    largest = std::max(largest, (to.position - from.position).norm() + turn * point.norm());
  return largest;
}

std::vector<double> blade_times(const Scenario& scenario, double stride, double column, int most_triangles) {
  const BladeSettings& blade = *scenario.blade;
  const double start = blade.path.front().time;
  const double duration = blade.path.back().time - start;
  const double travel = blade_travel(blade);
  const double wanted = blade.step > 0 ? duration / blade.step : std::max(1.0, std::ceil(travel / stride));
  const double rows = std::max(wanted, travel / column);
  const double triangles = 2 * rows * std::max(1.0, edge_length(blade) / column);
  if (triangles > most_triangles || wanted > static_cast<double>(most_steps))
    throw InputError(
        fmt::format("{}:{}: blade: its way of {:.3g} m in {:.0f} steps makes about {:.3g} triangles of cut; "
                    "allowed: {} in memory and {} steps. Give a longer step, a shorter way, or a coarser "
                    "cut.front_spacing",
                    scenario.file.string(), blade.line, travel, wanted, triangles, most_triangles, most_steps));
  const auto whole = static_cast<long>(std::floor(wanted * (1 + 1e-9)));
  std::vector<double> times, corners;
  for (long i = 0; i <= whole; ++i)
    times.push_back(start + std::min(duration, duration * static_cast<double>(i) / wanted));
  for (const BladePoint& corner : blade.path)
    corners.push_back(corner.time);
  return with_corners(std::move(times), corners, duration / wanted);
}

topology::ToolPose tool_pose(const ToolSettings& tool, const std::vector<ToolSample>& motion, double time) {
  const auto after = std::lower_bound(motion.begin(), motion.end(), time,
                                      [](const ToolSample& sample, double t) { return sample.time < t; });
  if (after == motion.begin() || (after != motion.end() && after->time == time))
    return after->pose;
  if (after == motion.end())
    return motion.back().pose;
  const ToolSample& before = *(after - 1);
  const double t = (time - before.time) / (after->time - before.time);
  return topology::pose_at(tool.shape, before.pose.point + t * (after->pose.point - before.pose.point), tool.axis);
}

/// Places along the edge, in the blade's frame, no farther than `apart` from one another.
std::vector<Vector3> edge_places(const BladeSettings& blade, double apart) {
  std::vector<Vector3> places{blade.edge.front()};
  for (std::size_t i = 1; i < blade.edge.size(); ++i) {
    const Vector3 along = blade.edge[i] - blade.edge[i - 1];
    const int parts = std::max(1, static_cast<int>(std::ceil(along.norm() / apart)));
    for (int k = 1; k <= parts; ++k)
      places.emplace_back(blade.edge[i - 1] + (static_cast<double>(k) / parts) * along);
  }
  return places;
}

} // namespace

std::optional<topology::BladePose> blade_pose(const BladeSettings& blade, double time) {
  const double slack = same_time * (blade.path.back().time - blade.path.front().time);
  if (time < blade.path.front().time - slack || time > blade.path.back().time + slack)
    return std::nullopt;
  std::size_t i = 1;
  while (i + 1 < blade.path.size() && time > blade.path[i].time)
    ++i;
  const BladePoint& a = blade.path[i - 1];
  const BladePoint& b = blade.path[i];
  const double t = std::clamp((time - a.time) / (b.time - a.time), 0.0, 1.0);
  topology::BladePose pose =
      pose_between({a.time, a.position, orientation(a.rotation)}, {b.time, b.position, orientation(b.rotation)}, t);
  pose.time = time;
  return pose;
}

double edge_travel(const std::vector<Vector3>& edge, const topology::BladePose& a, const topology::BladePose& b) {
  double largest = 0;
  for (const Vector3& x : edge)
    largest = std::max(largest, (b.orientation * x + b.position - a.orientation * x - a.position).norm());
  return largest;
}

topology::BladePose pose_between(const topology::BladePose& from, const topology::BladePose& to, double share) {
  return {from.time + share * (to.time - from.time), from.position + share * (to.position - from.position),
          from.orientation.slerp(share, to.orientation)};
}

std::vector<topology::BladePose> without_straight(const std::vector<Vector3>& edge, const topology::BladePose& from,
                                                  const std::vector<topology::BladePose>& way, double tolerance) {
  constexpr std::ptrdiff_t most_left_out = 64; // in a row: a long way costs no more than its length
  const auto is_straight = [&](const topology::BladePose& a, const topology::BladePose& b,
                               const topology::BladePose& x) {
    if (!x.position.allFinite() || !x.orientation.coeffs().allFinite()) // no sweep can take it
      return false;
    const auto place = [](const topology::BladePose& pose, const Vector3& point) -> Vector3 {
      return pose.orientation * point + pose.position;
    };
    double share = 0, longest = 0;
    for (const Vector3& point : edge) {
      const Vector3 start = place(a, point), along = place(b, point) - start;
      if (along.squaredNorm() > longest) {
        longest = along.squaredNorm();
        share = std::clamp((place(x, point) - start).dot(along) / longest, 0.0, 1.0);
      }
    }
    return edge_travel(edge, pose_between(a, b, share), x) <= tolerance;
  };
  std::vector<topology::BladePose> kept;
  const topology::BladePose* last = &from;
  for (auto first = way.begin(); first != way.end();) {
    auto next = first; // the farthest that can follow `last`
    while (next + 1 != way.end() && next - first < most_left_out &&
           std::all_of(first, next + 1, [&](const topology::BladePose& x) { return is_straight(*last, next[1], x); }))
      ++next;
    kept.push_back(*next);
    last = &*next;
    first = next + 1;
  }
  return kept;
}

double edge_length(const BladeSettings& blade) {
  double length = 0;
  for (std::size_t i = 1; i < blade.edge.size(); ++i)
    length += (blade.edge[i] - blade.edge[i - 1]).norm();
  return length;
}

double blade_travel(const BladeSettings& blade) {
  double travel = 0;
  for (std::size_t i = 1; i < blade.path.size(); ++i)
    travel += largest_way(blade, blade.path[i - 1], blade.path[i]);
  return travel;
}

std::vector<StepSample> schedule(const Scenario& scenario, const std::vector<ToolSample>& tool, double blade_stride,
                                 double column, int most_triangles) {
  std::vector<double> times;
  times.reserve(tool.size());
  for (const ToolSample& sample : tool)
    times.push_back(sample.time);
  if (scenario.blade) {
    const std::vector<double> blade = blade_times(scenario, blade_stride, column, most_triangles);
    times.insert(times.end(), blade.begin(), blade.end());
  }
  if (times.empty())
    times.push_back(0);
  std::sort(times.begin(), times.end());
  const double tolerance = same_time * (times.back() - times.front());
  times.erase(std::unique(times.begin(), times.end(), [&](double a, double b) { return b - a <= tolerance; }),
              times.end());
  std::vector<StepSample> steps;
  for (const double time : times) {
    StepSample sample{time, std::nullopt, std::nullopt};
    if (!tool.empty())
      sample.tool = tool_pose(*scenario.tool, tool, time);
    if (scenario.blade)
      sample.blade = blade_pose(*scenario.blade, time);
    steps.push_back(std::move(sample));
  }
  return steps;
}

BladeWay blade_way(const BladeSettings& blade, const topology::Domain& domain, double apart) {
  const std::vector<Vector3> columns = edge_places(blade, apart);
  struct Place {
    Vector3 point;
    double distance; // m, signed
  };
  const auto nearest_at = [&](double time) {
    const topology::BladePose pose = *blade_pose(blade, time);
    Place nearest{Vector3::Zero(), std::numeric_limits<double>::infinity()};
    for (const Vector3& column : columns) {
      const Vector3 x = placed(pose, column);
      if (const double distance = domain.signed_distance(x); distance < nearest.distance)
        nearest = {x, distance};
    }
    return nearest;
  };
  Place place = nearest_at(blade.path.front().time);
  BladeWay way{std::max(0.0, -place.distance), place.point, std::max(0.0, place.distance)};
  for (std::size_t i = 1; i < blade.path.size(); ++i) {
    const BladePoint& a = blade.path[i - 1];
    const BladePoint& b = blade.path[i];
    const double length = std::max(apart, largest_way(blade, a, b));
    for (double gone = 0; gone < length && way.nearest > 0;) {
      gone = std::min(length, gone + std::max(apart, 0.25 * place.distance)); // far from the body it goes on faster
      place = nearest_at(a.time + (b.time - a.time) * gone / length);
      way.nearest = std::min(way.nearest, std::max(0.0, place.distance));
    }
  }
  return way;
}

std::vector<std::array<Vector3, 2>> blade_tracks(const BladeSettings& blade, const topology::Domain& domain,
                                                 double apart) {
  const std::vector<Vector3> columns = edge_places(blade, apart);
  std::vector<std::array<Vector3, 2>> tracks;
  for (std::size_t i = 1; i < blade.path.size(); ++i) {
    const BladePoint& a = blade.path[i - 1];
    const BladePoint& b = blade.path[i];
    const double turn = orientation(a.rotation).angularDistance(orientation(b.rotation)) * 180 / std::numbers::pi;
    // Short enough to leave out what is far from the body.
    const double reach = std::max(4 * apart, 0.1 * domain.bounds().extent().maxCoeff());
    const int parts = std::max({1, static_cast<int>(std::ceil(turn / track_degrees)),
                                static_cast<int>(std::ceil(largest_way(blade, a, b) / reach))});
    for (int k = 0; k < parts; ++k) {
      const auto from = blade_pose(blade, a.time + (b.time - a.time) * k / parts);
      const auto to = blade_pose(blade, k + 1 == parts ? b.time : a.time + (b.time - a.time) * (k + 1) / parts);
      for (const Vector3& point : columns) {
        const std::array<Vector3, 2> track{placed(*from, point), placed(*to, point)};
        const Vector3 middle = 0.5 * (track[0] + track[1]);
        if (domain.signed_distance(middle) < apart + 0.5 * (track[1] - track[0]).norm())
          tracks.push_back(track);
      }
    }
  }
  return tracks;
}

} // namespace spherecut::app
