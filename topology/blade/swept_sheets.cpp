#include "topology/blade/swept_sheets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

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

/// The edge of a triangle that faces one of its vertices.
std::array<int, 2> edge_facing(const Triangle& t, int vertex) {
  const std::size_t c = t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2;
  return {t[(c + 1) % 3], t[(c + 2) % 3]};
}

/// Whether the edges that face a vertex make one chain, open or closed.
bool is_one_fan(const std::vector<std::array<int, 2>>& edges) {
  std::map<int, int> next, previous;
  for (const auto& [from, to] : edges)
    if (!next.emplace(from, to).second || !previous.emplace(to, from).second)
      return false;
  int first = edges.front()[0];
  for (const auto& [from, to] : next)
    if (!previous.contains(from))
      first = from;
  std::size_t length = 0;
  for (int at = first; next.contains(at) && (length == 0 || at != first); at = next.at(at))
    ++length;
  return length == edges.size();
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
  around_.emplace_back();
  return static_cast<int>(sheets_.size()) - 1;
}

int SweptSheets::add_vertex(int sheet, const Vector3& x) {
  sheets_[sheet].vertices.push_back(x);
  around_[sheet].emplace_back();
  return static_cast<int>(sheets_[sheet].vertices.size()) - 1;
}

void SweptSheets::add_triangle(int sheet, const Triangle& triangle) {
  const int place = static_cast<int>(places_.size());
  places_.push_back({sheet, static_cast<int>(sheets_[sheet].triangles.size())});
  for (const int vertex : triangle)
    around_[sheet][vertex].push_back(places_.back().triangle);
  sheets_[sheet].triangles.push_back(triangle);
  for_cells(box_of(corners(places_.back()), 1.01 * thickness_),
            [&](std::uint64_t key) { cells_[key].push_back(place); });
}

bool SweptSheets::is_border(int sheet, int from, int to) const {
  const std::vector<Triangle>& triangles = sheets_[sheet].triangles;
  const std::vector<int>& around = around_[sheet][from];
  return std::count_if(around.begin(), around.end(), [&](int t) {
           return std::find(triangles[t].begin(), triangles[t].end(), to) != triangles[t].end();
         }) == 1;
}

void SweptSheets::near(int sheet, const Vector3& x, double reach, std::vector<int>& triangles) const {
  for_cells({x.array() - reach, x.array() + reach}, [&](std::uint64_t key) {
    if (const auto found = cells_.find(key); found != cells_.end())
      for (const int place : found->second)
        if (places_[place].sheet == sheet)
          triangles.push_back(places_[place].triangle);
  });
}

// Whether a triangle lies back on the neighbour that it gets at an edge of the sheet.
bool SweptSheets::folds_back(int sheet, const Triangle& indices, const std::array<Vector3, 3>& p) const {
  constexpr double sharpest = -0.5; // cosine of the angle between normals
  const Vector3 normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  for (std::size_t e = 0; e < 3; ++e) {
    const int from = indices[e], to = indices[(e + 1) % 3];
    if (from >= std::ssize(around_[sheet]) || to >= std::ssize(around_[sheet]))
      continue;
    for (const int t : around_[sheet][from]) {
      const Triangle& other = sheets_[sheet].triangles[t];
      if (std::find(other.begin(), other.end(), to) == other.end())
        continue;
      const auto q = corners({sheet, t});
      if (normal.dot((q[1] - q[0]).cross(q[2] - q[0]).normalized()) < sharpest)
        return true;
    }
  }
  return false;
}

bool SweptSheets::stays_sheet(int sheet, const std::vector<Triangle>& added,
                              const std::vector<std::array<Vector3, 3>>& corners) const {
  for (std::size_t t = 0; t < added.size(); ++t)
    if (folds_back(sheet, added[t], corners[t]))
      return false;
  std::map<int, std::vector<std::array<int, 2>>> facing; // by vertex
  for (const Triangle& t : added)
    for (const int vertex : t)
      facing[vertex].push_back(edge_facing(t, vertex));
  return std::all_of(facing.begin(), facing.end(), [&](auto& vertex) {
    auto& [v, edges] = vertex;
    if (v < std::ssize(around_[sheet]))
      for (const int t : around_[sheet][v])
        edges.push_back(edge_facing(sheets_[sheet].triangles[t], v));
    return is_one_fan(edges);
  });
}

bool SweptSheets::is_on_border(int sheet, int vertex) const {
  const std::vector<int>& around = around_[sheet][vertex];
  return std::any_of(around.begin(), around.end(), [&](int t) {
    const Triangle& triangle = sheets_[sheet].triangles[t];
    return std::any_of(triangle.begin(), triangle.end(),
                       [&](int other) { return other != vertex && is_border(sheet, vertex, other); });
  });
}

// Over a ridge between triangles x lies over none of them: the foot is on the nearest edge of a sheet then, if that is
// not on its border.
std::optional<SweptSheets::Foot> SweptSheets::on_ridge(const Vector3& x, const std::vector<int>& places) const {
  struct Nearest {
    double distance;
    Foot foot;
    bool on_border;
  };
  std::vector<Nearest> of_sheets;
  for (const int place : places) {
    const int sheet = places_[place].sheet;
    const auto p = corners(places_[place]);
    const Triangle& vertices = sheets_[sheet].triangles[places_[place].triangle];
    for (std::size_t e = 0; e < 3; ++e) {
      const std::size_t next = (e + 1) % 3;
      const Vector3 along = p[next] - p[e];
      const double s = std::clamp((x - p[e]).dot(along) / along.squaredNorm(), 0.0, 1.0);
      const Vector3 foot = p[e] + s * along;
      const double distance = (foot - x).norm();
      auto known =
          std::find_if(of_sheets.begin(), of_sheets.end(), [&](const Nearest& n) { return n.foot.sheet == sheet; });
      if (distance > thickness_ || (known != of_sheets.end() && known->distance <= distance))
        continue;
      const bool on_border = s == 0   ? is_on_border(sheet, vertices[e])
                             : s == 1 ? is_on_border(sheet, vertices[next])
                                      : is_border(sheet, vertices[e], vertices[next]);
      const Nearest nearest{distance, {foot, (p[1] - p[0]).cross(p[2] - p[0]).normalized(), sheet}, on_border};
      if (known == of_sheets.end())
        of_sheets.push_back(nearest);
      else
        *known = nearest;
    }
  }
  std::optional<Foot> foot;
  double least = thickness_;
  for (const Nearest& nearest : of_sheets)
    if (!nearest.on_border && nearest.distance <= least) {
      least = nearest.distance;
      foot = nearest.foot;
    }
  return foot;
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
    if (!nearest)
      nearest = on_ridge(x, found->second);
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
