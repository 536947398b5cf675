#include "topology/swept_sheets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::topology {

namespace {

using Corners = std::array<Vector3, 3>;

/// Whether no plane across `axis` (any length) passes between the triangles with more than `gap` m to spare.
bool overlap_along(const Vector3& axis, const Corners& p, const Corners& q, double gap) {
  const double a = axis.dot(p[0]), b = axis.dot(p[1]), c = axis.dot(p[2]);
  const double d = axis.dot(q[0]), e = axis.dot(q[1]), f = axis.dot(q[2]);
  const double apart = std::max(std::min({a, b, c}) - std::max({d, e, f}), std::min({d, e, f}) - std::max({a, b, c}));
  return apart <= gap * axis.norm();
}

/// Whether two triangles meet, by separating axes; closer than `gap` m counts as meeting.
bool meet(const Corners& p, const Corners& q, double gap) {
  const Vector3 n = (p[1] - p[0]).cross(p[2] - p[0]), m = (q[1] - q[0]).cross(q[2] - q[0]);
  if (!overlap_along(n, p, q, gap) || !overlap_along(m, p, q, gap))
    return false;
  for (int i = 0; i < 3; ++i) {
    const Vector3 u = p[(i + 1) % 3] - p[i], v = q[(i + 1) % 3] - q[i];
    if (!overlap_along(n.cross(u), p, q, gap) || !overlap_along(m.cross(v), p, q, gap))
      return false;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vector3 u = p[(i + 1) % 3] - p[i], v = q[(j + 1) % 3] - q[j], axis = u.cross(v);
      // Nearly parallel edges give no axis of their own.
      if (axis.squaredNorm() > 1e-16 * u.squaredNorm() * v.squaredNorm() && !overlap_along(axis, p, q, gap))
        return false;
    }
  return true;
}

BoundingBox box_of(const Corners& p, double margin) {
  return {p[0].cwiseMin(p[1]).cwiseMin(p[2]).array() - margin, p[0].cwiseMax(p[1]).cwiseMax(p[2]).array() + margin};
}

} // namespace

template <class Visit>
void SweptSheets::for_cells(const BoundingBox& box, const Visit& visit) const {
  std::array<long, 3> from{}, to{};
  for (int d = 0; d < 3; ++d) {
    from[d] = static_cast<long>(std::floor(box.lower[d] / cell_));
    to[d] = static_cast<long>(std::floor(box.upper[d] / cell_));
  }
  // 21 bits a coordinate: bodies of up to a million cells a side. Beyond, cells share a key, which costs time alone.
  constexpr std::uint64_t bits = (1U << 21U) - 1;
  for (long x = from[0]; x <= to[0]; ++x)
    for (long y = from[1]; y <= to[1]; ++y)
      for (long z = from[2]; z <= to[2]; ++z)
        visit((static_cast<std::uint64_t>(x) & bits) | ((static_cast<std::uint64_t>(y) & bits) << 21U) |
              ((static_cast<std::uint64_t>(z) & bits) << 42U));
}

std::array<Vector3, 3> SweptSheets::corners(const Place& place) const {
  const SurfaceMesh& mesh = sheets_[place.sheet];
  const Triangle& t = mesh.triangles[place.triangle];
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

int SweptSheets::add_sheet() {
  sheets_.emplace_back();
  return static_cast<int>(sheets_.size()) - 1;
}

int SweptSheets::add_vertex(int sheet, const Vector3& x) {
  sheets_[sheet].vertices.push_back(x);
  return static_cast<int>(sheets_[sheet].vertices.size()) - 1;
}

void SweptSheets::add_triangle(int sheet, const Triangle& triangle) {
  const int place = static_cast<int>(places_.size());
  places_.push_back({sheet, static_cast<int>(sheets_[sheet].triangles.size())});
  sheets_[sheet].triangles.push_back(triangle);
  for_cells(box_of(corners(places_.back()), 1.01 * thickness_),
            [&](std::uint64_t key) { cells_[key].push_back(place); });
}

std::optional<SweptSheets::Foot> SweptSheets::on_sheet(const Vector3& x) const {
  std::optional<Foot> nearest;
  double nearest_height = thickness_;
  for_cells({x, x}, [&](std::uint64_t key) {
    const auto found = cells_.find(key);
    if (found == cells_.end())
      return;
    for (const int place : found->second) {
      const auto p = corners(places_[place]);
      const Vector3 area_vector = (p[1] - p[0]).cross(p[2] - p[0]);
      const double squared = area_vector.squaredNorm();
      const double height = std::abs(area_vector.dot(x - p[0])) / std::sqrt(squared);
      if (height > nearest_height || (nearest && height == nearest_height))
        continue;
      // Barycentric coordinates of the foot; neighbours overlap by a hair.
      bool over = true;
      for (int e = 0; e < 3 && over; ++e)
        over = area_vector.dot((p[(e + 1) % 3] - p[e]).cross(x - p[e])) >= -1e-6 * squared;
      if (!over)
        continue;
      nearest_height = height;
      nearest = Foot{x - area_vector.dot(x - p[0]) / squared * area_vector, area_vector / std::sqrt(squared),
                     places_[place].sheet};
      for (const Vector3& corner : p)
        if ((corner - nearest->point).norm() <= thickness_)
          nearest->point = corner;
    }
  });
  return nearest;
}

bool SweptSheets::crosses(int sheet, const Triangle& indices, const std::array<Vector3, 3>& p) const {
  const BoundingBox box = box_of(p, 0);
  bool meets = false;
  for_cells(box, [&](std::uint64_t key) {
    const auto found = cells_.find(key);
    if (meets || found == cells_.end())
      return;
    for (const int place : found->second) {
      if (places_[place].sheet != sheet)
        continue;
      const Corners q = corners(places_[place]);
      const Triangle& other = sheets_[sheet].triangles[places_[place].triangle];
      if (std::any_of(other.begin(), other.end(),
                      [&](int v) { return std::find(indices.begin(), indices.end(), v) != indices.end(); }))
        continue;
      if (meet(p, q, 1e-9 * cell_)) {
        meets = true;
        return;
      }
    }
  });
  return meets;
}

} // namespace spherecut::topology
