#include "src/scenario/tool_motion.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double touch_tolerance = 1e-7; // m
constexpr int default_steps = 20;

topology::ToolPose pose_of(const ToolSettings& tool, const Vector3& point) {
  return topology::pose_at(tool.shape, point, tool.axis);
}

// Way along the line from target to the first touch, by sphere tracing: the tool may always move by its clearance.
std::optional<double> way_to_touch(const ToolSettings& tool, const Approach& approach,
                                   const topology::ContactQuery& organ, const BoundingBox& box) {
  const double reach = box.extent().norm() + (box.centre() - approach.target).norm();
  double way = -reach - 2 * approach.clearance;
  if (const auto* laparoscope = std::get_if<topology::Laparoscope>(&tool.shape))
    way = std::max(way, -0.9 * (laparoscope->port - approach.target).norm()); // the tip stays in front of its port
  if (const auto start = organ.first_touch(tool.shape, pose_of(tool, approach.target + way * approach.direction));
      start.depth > 0)
    throw InputError("tool.approach: there is no start outside the organ on this line; move the target, or the port");
  while (way < reach) {
    const auto contact = organ.first_touch(tool.shape, pose_of(tool, approach.target + way * approach.direction));
    if (contact.depth > -touch_tolerance)
      return way;
    way += -contact.depth;
  }
  return std::nullopt;
}

// Straight pieces through the poses of the file.
std::vector<PathPoint> waypoints(const ToolSettings& tool, const topology::ContactQuery& organ,
                                 const BoundingBox& box) {
  if (const auto* path = std::get_if<std::vector<PathPoint>>(&tool.motion))
    return *path;
  const auto& approach = std::get<Approach>(tool.motion);
  const double touch = way_to_touch(tool, approach, organ, box).value_or(0);
  return {{0, approach.target + (touch - approach.clearance) * approach.direction},
          {approach.duration, approach.target + (touch + approach.depth) * approach.direction}};
}

Vector3 position_at(const std::vector<PathPoint>& path, double time) {
  for (std::size_t i = 1; i < path.size(); ++i)
    if (time <= path[i].time) {
      const double t = (time - path[i - 1].time) / (path[i].time - path[i - 1].time);
      return path[i - 1].position + t * (path[i].position - path[i - 1].position);
    }
  return path.back().position;
}

std::string metres_text(const Vector3& v) {
  return fmt::format("[{:.4g}, {:.4g}, {:.4g}] m", v.x(), v.y(), v.z());
}

} // namespace

std::vector<double> with_corners(std::vector<double> times, const std::vector<double>& corners, double step) {
  constexpr double same = 1e-6; // of a step: a shorter one is rounding, not a step
  for (const double corner : corners) {
    const auto after = std::lower_bound(times.begin(), times.end(), corner - same * step);
    if (after == times.end() || *after > corner + same * step)
      times.insert(after, corner);
  }
  return times;
}

std::vector<ToolSample> tool_motion(const ToolSettings& tool, const topology::ContactQuery& organ,
                                    const BoundingBox& bounds) {
  const std::vector<PathPoint> path = waypoints(tool, organ, bounds);
  const double start = path.front().time;
  const double duration = path.back().time - start;
  const double step = tool.step > 0 ? tool.step : duration / default_steps;
  const auto whole = static_cast<long>(std::floor(duration / step * (1 + 1e-9)));
  std::vector<double> times, corners;
  for (long i = 0; i <= whole; ++i)
    times.push_back(start + std::min(duration, static_cast<double>(i) * step));
  for (const PathPoint& corner : path)
    corners.push_back(corner.time);
  std::vector<ToolSample> motion;
  for (const double time : with_corners(std::move(times), corners, step))
    motion.push_back({time, pose_of(tool, position_at(path, time))});

  if (tool.grasp)
    return motion;
  const topology::ToolPose& pose = motion.front().pose;
  const auto contact = organ.first_touch(tool.shape, pose);
  const double inside = organ.closest_point(pose.point).depth;
  if (contact.depth > touch_tolerance || inside > touch_tolerance)
    throw InputError(fmt::format("{}: the tool starts inside the organ, {:.3g} mm deep at t = {:g} s; allowed: a start "
                                 "outside",
                                 std::holds_alternative<Approach>(tool.motion)
                                     ? fmt::format("tool.approach: its start at {}", metres_text(pose.point))
                                     : fmt::format("tool.path[1].position = {}", metres_text(pose.point)),
                                 1e3 * std::max(contact.depth, inside), motion.front().time));
  return motion;
}

std::optional<FirstTouch> first_touch(const ToolSettings& tool, const std::vector<ToolSample>& motion,
                                      const topology::ContactQuery& organ) {
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const auto contact = organ.first_touch(tool.shape, motion[i].pose);
    if (contact.depth <= 0)
      continue;
    FirstTouch touch{contact, motion[i].pose, i};
    if (i == 0)
      return touch;
    const Vector3 clear = motion[i - 1].pose.point;
    const Vector3 way = motion[i].pose.point - clear;
    double low = 0;
    double high = 1;
    while ((high - low) * way.norm() > touch_tolerance) {
      const double middle = 0.5 * (low + high);
      const auto pose = pose_of(tool, clear + middle * way);
      const auto there = organ.first_touch(tool.shape, pose);
      if (there.depth > 0) {
        high = middle;
        touch.contact = there;
        touch.pose = pose;
      } else {
        low = middle;
      }
    }
    return touch;
  }
  return std::nullopt;
}

std::optional<FirstTouch> nearest_approach(const ToolSettings& tool, const std::vector<ToolSample>& motion,
                                           const topology::ContactQuery& organ) {
  std::optional<FirstTouch> nearest;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const auto contact = organ.first_touch(tool.shape, motion[i].pose);
    if (!nearest || contact.depth > nearest->contact.depth)
      nearest = FirstTouch{contact, motion[i].pose, i};
  }
  return nearest;
}

} // namespace spherecut::app
