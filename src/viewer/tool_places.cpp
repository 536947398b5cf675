#include "src/viewer/tool_places.hpp"

#include <algorithm>
#include <limits>

namespace spherecut::app {
namespace {

constexpr double parking = 0.15; // of the organ's diagonal, beyond where the tool starts

PathPose start_of(const std::vector<StepSample>& steps, bool blade) {
  for (const StepSample& sample : steps)
    if (blade && sample.blade)
      return {0, sample.blade->position, sample.blade->orientation};
    else if (!blade && sample.tool)
      return {0, sample.tool->point, Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), sample.tool->axis)};
  return {};
}

} // namespace

ToolPlaces::ToolPlaces(const Scenario& scenario, const Session& session)
    : scenario_(scenario), domain_(session.organ().domain), query_(domain_->surface()) {
  if (scenario.tool)
    tool_start_ = start_of(session.steps(), false);
  if (scenario.blade)
    blade_start_ = start_of(session.steps(), true);
}

std::vector<HandMode> ToolPlaces::modes() const {
  std::vector<HandMode> modes;
  if (scenario_.tool)
    modes.push_back(scenario_.tool->grasp ? HandMode::grasper : HandMode::probe);
  if (scenario_.blade)
    modes.push_back(HandMode::blade);
  return modes;
}

PointerTarget ToolPlaces::parked(HandMode mode) const {
  const double away = parking * domain_->bounds().extent().norm();
  PointerTarget target;
  target.mode = mode;
  if (mode == HandMode::blade) {
    target.orientation = blade_start_->orientation;
    target.position = blade_start_->position + away * domain_->normal(blade_start_->position);
    return target;
  }
  target.orientation = tool_start_->orientation;
  const topology::ToolPose pose =
      topology::pose_at(scenario_.tool->shape, tool_start_->position, tool_start_->orientation * Vector3::UnitZ());
  target.position = pose.point + away * pose.axis;
  return target;
}

bool ToolPlaces::clear_of_organ(const PointerTarget& target) const {
  if (target.mode != HandMode::blade) {
    const double radius = topology::tip_radius(scenario_.tool->shape);
    const topology::ToolPose pose =
        tool_pose(scenario_.tool->shape, {0, 0, target.position, target.orientation, true, 0, 0});
    return domain_->signed_distance(pose.point + radius * pose.axis) > radius;
  }
  const std::vector<Vector3>& edge = scenario_.blade->edge;
  return std::all_of(edge.begin(), edge.end(), [&](const Vector3& x) {
    return domain_->signed_distance(target.orientation * x + target.position) > 0;
  });
}

ToolPlaces::Touch ToolPlaces::touch(const topology::ToolShape& tool, const DeviceState& device) const {
  Touch touch;
  if (device.mode != static_cast<std::uint16_t>(HandMode::blade)) {
    const topology::ToolPose pose = tool_pose(tool, device);
    touch.axis = pose.axis;
    touch.contact = query_.first_touch(tool, pose);
    if (device.mode == static_cast<std::uint16_t>(HandMode::grasper)) // held or not: against the surface at rest
      touch.depth = -domain_->signed_distance(device.position);
    return touch;
  }
  touch.axis = device.orientation * Vector3::UnitZ();
  double least = std::numeric_limits<double>::infinity();
  for (const Vector3& x : scenario_.blade->edge) {
    const Vector3 place = device.orientation * x + device.position;
    if (const double distance = domain_->signed_distance(place); distance < least) {
      least = distance;
      touch.contact.point = domain_->closest_surface_point(place);
    }
  }
  touch.contact.normal = domain_->normal(touch.contact.point);
  touch.depth = -least;
  return touch;
}

} // namespace spherecut::app
