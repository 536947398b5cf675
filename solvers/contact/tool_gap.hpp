// The gap between a point of the body and the part of a tool that can press on it. Nothing here allocates or throws.
#pragma once

#include "topology/tool/tool.hpp"

#include <span>

namespace spherecut::solvers {

struct Gap {
  double distance;
  Vector3 normal; // outward from the tool
};

/// A tool at a pose, and the direction in which its ball presses into the body.
struct PressingTool {
  const topology::ToolShape& shape;
  topology::ToolPose pose;
  Vector3 front;
};

/// The tool with its front: against the surface about the tip, so that an oblique instrument presses as a ball does.
/// `rest` and `normals` (m, unit) are those of the candidate nodes.
PressingTool pressing(const topology::ToolShape& shape, const topology::ToolPose& pose, std::span<const Vector3> rest,
                      std::span<const Vector3> normals) noexcept;

/// Gap between a point and the part of the tool that can press on it. Linear elasticity cannot fold tissue over the
/// flank of a tool: nodes driven past it would slip off one by one. So nothing is pushed sideways more than 55 degrees
/// from the front: under a flat punch the end face counts, whatever the depth, and a ball runs on as its tangent cone.
/// This changes nothing for presses shallower than about half the radius. An instrument's shaft counts as it is.
/// `hold`: depth below a punch's flank, over that above its end face, up to which the flank counts all the same.
Gap contact_gap(const PressingTool& tool, const Vector3& x, double hold = 0) noexcept;

/// Of a node that a punch's flank presses: it lies within the punch by rounding.
inline constexpr double flank_hold = 0.01;

} // namespace spherecut::solvers
