#include "topology/blade/abutting_strip.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/sheet_front.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace spherecut::topology {

double quality(const Vector3& a, const Vector3& b, const Vector3& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() / longest;
}

std::optional<Strip> strip_between(const std::vector<StripPoint>& lower, const std::vector<StripPoint>& upper,
                                   int base) {
  Strip strip;
  std::vector<StripPoint> known; // by place; those that the sheet has first
  for (const std::vector<StripPoint>* points : {&lower, &upper})
    std::copy_if(points->begin(), points->end(), std::back_inserter(known),
                 [](const StripPoint& point) { return point.vertex >= 0; });
  const auto vertices_of = [&](const std::vector<StripPoint>& points) {
    std::vector<int> ids;
    for (const StripPoint& point : points) {
      auto same = std::find_if(known.begin(), known.end(), [&](const StripPoint& k) { return k.x == point.x; });
      if (same == known.end()) {
        same = known.insert(same, {point.x, base + static_cast<int>(strip.vertices.size())});
        strip.vertices.push_back(point.x);
      }
      ids.push_back(same->vertex);
    }
    return ids;
  };
  const std::vector<int> low = vertices_of(lower), up = vertices_of(upper);
  Vector3 whole = Vector3::Zero(); // twice the area vector of what lies between
  const auto add_side = [&](const std::vector<StripPoint>& points, double sign) {
    for (std::size_t k = 1; k < points.size(); ++k)
      whole += sign * (points[k - 1].x - lower[0].x).cross(points[k].x - lower[0].x);
  };
  add_side(lower, 1);
  add_side(upper, -1);
  whole += (lower.back().x - lower[0].x).cross(upper.back().x - lower[0].x);
  // Of all ways to go on, on one polyline or the other, that which folds least often, a triangle facing the other way;
  // then that whose flattest triangle is the best; then the best sum. Material within a fold would see nothing.
  const std::size_t m = low.size(), n = up.size();
  struct Way {
    int folds = std::numeric_limits<int>::max();
    double flattest = -1, sum = 0; // below 0: none
    bool came_low = false;
  };
  std::vector<Way> ways(m * n);
  const auto way = [&](std::size_t i, std::size_t j) -> Way& { return ways[i * n + j]; };
  const auto go = [&](const Way& from, int p, int q, int r, const std::array<Vector3, 3>& x, bool low_side, Way& to) {
    const bool is_none = p == q || q == r || r == p;
    const bool folds = !is_none && (x[1] - x[0]).cross(x[2] - x[0]).dot(whole) < 0;
    const double good = is_none ? 1 : quality(x[0], x[1], x[2]);
    if (std::min(from.flattest, good) <= flattest_of_strip)
      return;
    const Way next{from.folds + (folds ? 1 : 0), std::min(from.flattest, good), from.sum + (is_none ? 0 : good),
                   low_side};
    if (std::tuple(-next.folds, next.flattest, next.sum) > std::tuple(-to.folds, to.flattest, to.sum))
      to = next;
  };
  way(0, 0).folds = 0;
  way(0, 0).flattest = 1;
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      if (i + 1 < m)
        go(way(i, j), low[i], low[i + 1], up[j], {lower[i].x, lower[i + 1].x, upper[j].x}, true, way(i + 1, j));
      if (j + 1 < n)
        go(way(i, j), low[i], up[j + 1], up[j], {lower[i].x, upper[j + 1].x, upper[j].x}, false, way(i, j + 1));
    }
  if (way(m - 1, n - 1).flattest < 0)
    return std::nullopt;
  const auto add = [&](const Triangle& t, const std::array<Vector3, 3>& x) {
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
      return;
    strip.triangles.push_back(t);
    strip.corners.push_back(x);
  };
  for (std::size_t i = m - 1, j = n - 1; i > 0 || j > 0;)
    if (way(i, j).came_low) {
      --i;
      add({low[i], low[i + 1], up[j]}, {lower[i].x, lower[i + 1].x, upper[j].x});
    } else {
      --j;
      add({low[i], up[j + 1], up[j]}, {lower[i].x, upper[j + 1].x, upper[j].x});
    }
  std::reverse(strip.triangles.begin(), strip.triangles.end());
  std::reverse(strip.corners.begin(), strip.corners.end());
  const auto has_edge = [&](int p, int q) {
    return std::any_of(strip.triangles.begin(), strip.triangles.end(), [&](const Triangle& t) {
      return (t[0] == p && t[1] == q) || (t[1] == p && t[2] == q) || (t[2] == p && t[0] == q);
    });
  };
  for (std::size_t j = 0; j + 1 < up.size(); ++j) {
    const bool is_border = has_edge(up[j + 1], up[j]) && !has_edge(up[j], up[j + 1]);
    strip.leads.push_back(is_border ? std::array<int, 2>{up[j], up[j + 1]} : std::array<int, 2>{-1, -1});
  }
  if (strip.triangles.empty())
    return strip;
  SurfaceMesh alone; // the triangles with vertices of their own
  std::vector<int> place;
  for (const Triangle& t : strip.triangles) {
    Triangle own{};
    for (std::size_t c = 0; c < 3; ++c) {
      const auto at = std::find(place.begin(), place.end(), t[c]);
      own[c] = static_cast<int>(at - place.begin());
      if (at == place.end()) {
        place.push_back(t[c]);
        alone.vertices.push_back(
            std::find_if(known.begin(), known.end(), [&](const StripPoint& k) { return k.vertex == t[c]; })->x);
      }
    }
    alone.triangles.push_back(own);
  }
  try {
    check_sheet(alone, "strip");
  } catch (const InputError&) {
    return std::nullopt;
  }
  return strip;
}

} // namespace spherecut::topology
