#include "topology/wound/triangle_meeting.hpp"

#include "topology/surface/triangle_corners.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace spherecut::topology {

namespace {

using Signs = std::array<int, 3>;

bool all_on_one_side(const Signs& side) {
  return side[0] != 0 && side[0] == side[1] && side[1] == side[2];
}

/// Whether a point of the triangle's plane lies in it, border included.
bool within(const ExactPoints& points, int p, const Triangle& t, int axis) {
  bool left = false, right = false;
  for (int e = 0; e < 3; ++e) {
    const int turn = points.turn(t[e], t[(e + 1) % 3], p, axis);
    left = left || turn > 0;
    right = right || turn < 0;
  }
  return !(left && right);
}

/// Sides of a's corners to the plane of b.
Signs sides(const ExactPoints& points, const Triangle& a, const Triangle& b) {
  Signs side{};
  for (int c = 0; c < 3; ++c)
    side[c] = has_corner(b, a[c]) ? 0 : points.orientation(b[0], b[1], b[2], a[c]);
  return side;
}

/// Points where the corners and edges of a, not coplanar with b, meet it.
void edges_through(ExactPoints& points, const Triangle& a, const Signs& side, const Triangle& b,
                   std::vector<int>& found) {
  for (int e = 0; e < 3; ++e) {
    const int p = a[e], q = a[(e + 1) % 3];
    if (side[e] == 0 && within(points, p, b, points.widest_axis(b)))
      found.push_back(p);
    if (side[e] * side[(e + 1) % 3] >= 0)
      continue;
    bool left = false, right = false;
    for (int k = 0; k < 3 && !(left && right); ++k) {
      const int turn = points.orientation(p, q, b[k], b[(k + 1) % 3]);
      left = left || turn > 0;
      right = right || turn < 0;
    }
    if (!(left && right))
      found.push_back(points.edge_plane(p, q, b));
  }
}

/// Ends of the part of the segment p q that lies in the coplanar triangle.
std::vector<int> clip(ExactPoints& points, int p, int q, const Triangle& t, int axis) {
  std::vector<int> ends;
  for (const int end : {p, q})
    if (within(points, end, t, axis))
      ends.push_back(end);
  for (int e = 0; e < 3; ++e) {
    const int r = t[e], s = t[(e + 1) % 3];
    const int to_r = points.turn(p, q, r, axis), to_s = points.turn(p, q, s, axis);
    if (to_r == 0 && r != p && r != q && points.compare(r, p) * points.compare(r, q) < 0)
      ends.push_back(r);
    if (to_r * to_s < 0 && points.turn(r, s, p, axis) * points.turn(r, s, q, axis) < 0)
      ends.push_back(points.edge_edge(p, q, r, s, axis));
  }
  keep_once(ends);
  return ends;
}

} // namespace

bool surely_apart(const ExactPoints& points, const Triangle& a, const Triangle& b) {
  Triangle shared{-1, -1, -1};
  int count = 0;
  for (const int p : a)
    if (has_corner(b, p))
      shared[count++] = p;
  if (count == 3)
    return true;
  if (count == 2)
    return points.same_side(shared[0], shared[1], third_corner(a, shared[0], shared[1]),
                            third_corner(b, shared[0], shared[1])) < 0;
  const Vector3& origin = points.position(count == 1 ? shared[0] : a[0]);
  Vector3 direction = Vector3::Zero();
  double extent = 0;
  for (int c = 0; c < 3; ++c) {
    const Vector3 to_a = points.position(a[c]) - origin, to_b = points.position(b[c]) - origin;
    if (count == 1)
      direction += to_a.stableNormalized() - to_b.stableNormalized();
    else
      direction += to_a - to_b;
    extent = std::max({extent, to_a.cwiseAbs().maxCoeff(), to_b.cwiseAbs().maxCoeff()});
  }
  double least_a = std::numeric_limits<double>::infinity(), most_b = -least_a;
  for (int c = 0; c < 3; ++c) {
    if (a[c] != shared[0])
      least_a = std::min(least_a, direction.dot(points.position(a[c]) - origin));
    if (b[c] != shared[0])
      most_b = std::max(most_b, direction.dot(points.position(b[c]) - origin));
  }
  // Far above the rounding of the products.
  const double margin = 1e-13 * (origin.cwiseAbs().maxCoeff() + extent) * direction.cwiseAbs().maxCoeff();
  return count == 1 ? least_a > margin && most_b < -margin : least_a > most_b + margin;
}

TriangleMeeting meet(ExactPoints& points, const Triangle& first, const Triangle& second) {
  TriangleMeeting meeting;
  const Signs side_first = sides(points, first, second);
  if (all_on_one_side(side_first))
    return meeting;
  if (side_first == Signs{}) {
    const int axis = points.widest_axis(second);
    for (int e = 0; e < 3; ++e) {
      meeting.on_first.push_back(clip(points, second[e], second[(e + 1) % 3], first, axis));
      meeting.on_second.push_back(clip(points, first[e], first[(e + 1) % 3], second, axis));
    }
    const auto nothing = [](const std::vector<int>& ends) { return ends.empty(); };
    std::erase_if(meeting.on_first, nothing);
    std::erase_if(meeting.on_second, nothing);
    return meeting;
  }
  const Signs side_second = sides(points, second, first);
  if (all_on_one_side(side_second))
    return meeting;
  // The planes cross in a line, on which each triangle covers an interval; all points found are ends of one interval
  // that lie in the other: at most two.
  std::vector<int> ends;
  edges_through(points, first, side_first, second, ends);
  edges_through(points, second, side_second, first, ends);
  keep_once(ends);
  if (!ends.empty()) {
    meeting.on_first.push_back(ends);
    meeting.on_second.push_back(ends);
  }
  return meeting;
}

} // namespace spherecut::topology
