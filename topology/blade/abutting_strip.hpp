// The strip of triangles between two polylines that a blade's edge leaves, where they have other numbers of points or
// meet at their ends. Used by the blade sweep alone.
#pragma once

#include "topology/surface/mesh.hpp"

#include <optional>

namespace spherecut::topology {

/// Height of a triangle over its longest edge, by that edge: 0 flat, 0.87 equilateral; below `flattest_of_strip` no
/// sheet has one.
double quality(const Vector3& a, const Vector3& b, const Vector3& c);
constexpr double flattest_of_strip = 1e-5;

/// Vertices and triangles to append to a sheet; vertices count on from those it has.
struct Strip {
  std::vector<Vector3> vertices;
  std::vector<Triangle> triangles;
  std::vector<std::array<Vector3, 3>> corners;
  std::vector<std::array<int, 2>> leads; // left and right vertex of each piece's new edge
};

/// A corner: its place, and the vertex that the sheet has there, -1: none.
struct StripPoint {
  Vector3 x;
  int vertex = -1;
};

/// Triangles from `lower` to `upper`, both from left to right. Points at the same place are one vertex. `base`: number
/// of vertices of the sheet. Its leads are those between the points of `upper`, -1 where no triangle is. Nothing when a
/// triangle would be flat, or the triangles are no sheet.
std::optional<Strip> strip_between(const std::vector<StripPoint>& lower, const std::vector<StripPoint>& upper,
                                   int base);

} // namespace spherecut::topology
