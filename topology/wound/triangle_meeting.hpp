// Where two triangles meet, exactly.
#pragma once

#include "topology/wound/exact_points.hpp"

namespace spherecut::topology {

/// Whether two triangles surely meet in nothing but the corners they share: a plane between them is found in doubles.
/// Also true of the same triangle twice.
bool surely_apart(const ExactPoints& points, const Triangle& a, const Triangle& b);

/// What each triangle leaves on the other: one point, or the two ascending ends of a segment, per entry. Triangles that
/// cross leave the same entry on both; coplanar ones leave their edges, each clipped by the other.
struct TriangleMeeting {
  std::vector<std::vector<int>> on_first, on_second;
};

TriangleMeeting meet(ExactPoints& points, const Triangle& first, const Triangle& second);

} // namespace spherecut::topology
