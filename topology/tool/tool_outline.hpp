// The section of a tool by a plane, as a curve to draw.
#pragma once

#include "topology/tool/tool.hpp"

#include <array>
#include <vector>

namespace spherecut::topology {

/// Outline of the tool in the plane through `origin` spanned by the unit vectors e1 and e2, perpendicular to each
/// other: points on the tool's surface within `reach` m of the origin, in coordinates (along e1, along e2), in order
/// around the tool and 0.125 degrees apart seen from the middle of its tip. Where it leaves the reach a point with NaN
/// parts the pieces. Of a shaft that the plane meets apart from the tip nothing is drawn; empty where it misses the
/// tip. Throws InputError when reach is not positive.
std::vector<std::array<double, 2>> tool_outline(const ToolShape& tool, const ToolPose& pose, const Vector3& origin,
                                                const Vector3& e1, const Vector3& e2, double reach);

} // namespace spherecut::topology
