// Points with exact rational coordinates behind plain numbers, and the exact decisions an arrangement needs.
#pragma once

#include "topology/base/types.hpp"

#include <memory>
#include <utility>

namespace spherecut::topology {

/// Points are numbered as they are first met; equal points have one number. Signs are exact: -1, 0 or 1. A plane figure
/// is seen along `axis` (0, 1, 2 for x, y, z), so that (axis + 1) % 3 and (axis + 2) % 3 are its coordinates.
class ExactPoints {
 public:
  ExactPoints();
  ~ExactPoints();
  ExactPoints(const ExactPoints&) = delete;
  ExactPoints& operator=(const ExactPoints&) = delete;

  /// The point with exactly these coordinates, m (finite).
  int add(const Vector3& x);
  /// Where the segment from p to q passes the plane of the triangle; p and q lie strictly on opposite sides.
  int edge_plane(int p, int q, const Triangle& triangle);
  /// Where the segment from p to q passes the line through r and s, all in one plane.
  int edge_edge(int p, int q, int r, int s, int axis);
  /// Mean of the corners.
  int centroid(const Triangle& triangle);

  [[nodiscard]] int count() const;
  /// Coordinates rounded, m; a function of the exact point.
  [[nodiscard]] const Vector3& position(int point) const;

  /// Sign of (q - p) x (r - p) . (s - p).
  [[nodiscard]] int orientation(int p, int q, int r, int s) const;
  /// Turn p, q, r in the projection along the axis: 1 for counter-clockwise.
  [[nodiscard]] int turn(int p, int q, int r, int axis) const;
  /// Sign of t x (r - u) . t x (s - u) with t = v - u: 1 when r and s, coplanar with u v, lie on one side of u v.
  [[nodiscard]] int same_side(int u, int v, int r, int s) const;
  /// Lexicographic order of x, y, z.
  [[nodiscard]] int compare(int p, int q) const;
  [[nodiscard]] bool collinear(int p, int q, int r) const;
  /// Along which axis the triangle appears largest (exactly, the first of equals); the same for coplanar triangles.
  [[nodiscard]] int widest_axis(const Triangle& triangle) const;

  /// Constrained Delaunay triangulation of a triangle (oriented as it) with segments and points within it; segments may
  /// cross and overlap. Depends only on the set of its points and lines, not on their order: among corners on one
  /// circle the least starts the fan.
  std::vector<Triangle> triangulate(const Triangle& triangle, const std::vector<std::pair<int, int>>& segments,
                                    const std::vector<int>& points);

 private:
  /// Points where segments of one plane cross away from their ends.
  std::vector<int> crossings(const std::vector<std::pair<int, int>>& segments, int axis);

  struct Data;
  std::unique_ptr<Data> data_;
};

} // namespace spherecut::topology
