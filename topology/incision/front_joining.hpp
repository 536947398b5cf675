// Fronts that run towards each other: the ligament between them is too narrow to be resolved, and one sheet goes over
// into the other.
#pragma once

#include "topology/incision/front_growth.hpp"

namespace spherecut::topology {

/// A piece of the front and the piece of another one that it faces.
struct FacingFronts {
  int sheet = -1, from = -1, to = -1; // border edge of the sheet, in the direction of its triangle
  int other_sheet = -1, other_from = -1, other_to = -1;
  Vector3 middle = Vector3::Zero(); // m, of the edge
  Vector3 across = Vector3::Zero(); // m, from there to the nearest point of the other edge
};

/// Edges of the front that have another front, of another sheet or of their own, within `reach` m ahead of them (within
/// 60 degrees of their way), which comes towards them (their ways differ by more than 120 degrees), with nothing in
/// between. Throws InputError when `reach` is not positive.
std::vector<FacingFronts> facing_fronts(const Incision& incision, double reach);

/// Parts the ligaments narrower than `reach` m: of every two runs of facing edges the sheet that comes first gets a
/// strip of triangles from its own border vertices to those of the other, so that the two abut on each other with the
/// same vertices, and are no front there any more. Where a run ends inside the body, the end of the strip is front.
/// Each edge is in one strip at most. No triangles: nothing faces. Throws InputError when `reach` is not positive.
FrontGrowth join_fronts(const Incision& incision, double reach);

} // namespace spherecut::topology
