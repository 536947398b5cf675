// Points on the faces of a cut, moved into their own material for sight lines along a face.
#pragma once

#include "topology/incision/incision.hpp"

namespace spherecut::topology {

/// x itself unless a sheet comes within `reach` m of it; then a point up to `height` m farther off that sheet on the
/// side of x, which x sees. Two points on the same face of a curved sheet do not see each other over its bulge, however
/// near they are to one another; lifted by a tenth of their distance they do, unless the radius of curvature is below
/// 1.3 times that distance. Faces stay hidden from each other.
Vector3 lift_off(const Incision& incision, const Vector3& x, double reach, double height);

/// The eye at the point x of a sphere of `radius` m, or at its centre: lifted by 0.05 of the radius when it is within
/// 0.02 of it of a sheet.
Eye eye_at(const Incision& incision, const Vector3& x, double radius);

} // namespace spherecut::topology
