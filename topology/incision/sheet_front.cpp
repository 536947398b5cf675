#include "topology/incision/sheet_front.hpp"

#include "topology/base/errors.hpp"
#include "topology/surface/half_edges.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <unordered_map>

namespace spherecut::topology {

namespace {

double body_size(const Domain& domain) {
  return domain.bounds().extent().norm();
}

void check_elements(const SurfaceMesh& sheet, const std::string& name) {
  if (sheet.triangles.empty())
    throw InputError(fmt::format("{} has no triangles", name));
  for (int v = 0; v < std::ssize(sheet.vertices); ++v)
    if (const Vector3& x = sheet.vertices[v]; !x.allFinite())
      throw InputError(fmt::format("{}: vertex {} ({}, {}, {}) is not finite", name, v, x.x(), x.y(), x.z()));
  for (int t = 0; t < std::ssize(sheet.triangles); ++t) {
    const Triangle& corners = sheet.triangles[t];
    for (const int v : corners)
      if (v < 0 || v >= std::ssize(sheet.vertices))
        throw InputError(fmt::format("{}: triangle {} refers to vertex {}, there are {} vertices", name, t, v,
                                     sheet.vertices.size()));
    const Vector3 &a = sheet.vertices[corners[0]], &b = sheet.vertices[corners[1]], &c = sheet.vertices[corners[2]];
    const double longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
    constexpr double shortest_edge = 1e-9, flattest = 1e-6;
    if (!(longest >= shortest_edge) || !((b - a).cross(c - a).norm() >= flattest * longest * longest))
      throw InputError(
          fmt::format("{}: triangle {} (vertices {}, {}, {}) is degenerate: longest edge {:.3g} m, area {:.3g} m2",
                      name, t, corners[0], corners[1], corners[2], longest, 0.5 * (b - a).cross(c - a).norm()));
  }
}

/// Refuses edges with three triangles or two of opposite orientation, and vertices where fans only touch.
void check_manifold(const SurfaceMesh& sheet, const std::string& name) {
  const HalfEdges edges(sheet);
  for (int t = 0; t < std::ssize(sheet.triangles); ++t)
    for (int e = 0; e < 3; ++e) {
      const int from = sheet.triangles[t][e], to = sheet.triangles[t][(e + 1) % 3];
      if (const int other = edges.triangle(from, to); other != t)
        throw InputError(fmt::format("{}: triangles {} and {} both run along the edge {} to {}: the sheet is not "
                                     "manifold there, or not consistently oriented",
                                     name, other, t, from, to));
    }
  // Around a vertex of one fan, going from triangle to triangle passes all of them.
  const auto next_vertex = [&](int t, int v, int step) { // corner of t `step` places after v
    const Triangle& corners = sheet.triangles[t];
    const int at = static_cast<int>(std::find(corners.begin(), corners.end(), v) - corners.begin());
    return corners[(at + step) % 3];
  };
  for (int v = 0; v < std::ssize(sheet.vertices); ++v) {
    const int around = edges.around(v);
    if (around == 0)
      continue;
    int passed = 1;
    const int first = edges.some_triangle(v);
    bool closed = false;
    for (int t = first; passed <= around; ++passed) { // counter-clockwise, across the edge v -> last corner
      t = edges.triangle(v, next_vertex(t, v, 2));
      if (t < 0)
        break;
      if (t == first) {
        closed = true;
        break;
      }
    }
    for (int t = first; !closed && passed <= around; ++passed) { // clockwise, across the edge first corner -> v
      t = edges.triangle(next_vertex(t, v, 1), v);
      if (t < 0)
        break;
    }
    if (passed != around)
      throw InputError(fmt::format("{}: parts of the sheet only touch at vertex {} ({}, {}, {})", name, v,
                                   sheet.vertices[v].x(), sheet.vertices[v].y(), sheet.vertices[v].z()));
  }
}

/// Area of the part of a triangle where the distance, linear between the corners, is negative.
double clipped_area(const std::array<Vector3, 3>& p, const std::array<double, 3>& d) {
  const double area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
  int inside = 0;
  for (const double value : d)
    inside += value < 0 ? 1 : 0;
  if (inside == 0 || inside == 3)
    return inside == 3 ? area : 0;
  for (int i = 0; i < 3; ++i)
    if ((d[i] < 0) == (inside == 1)) { // the corner that is alone on its side
      const double alone = area * (d[i] / (d[i] - d[(i + 1) % 3])) * (d[i] / (d[i] - d[(i + 2) % 3]));
      return inside == 1 ? alone : area - alone;
    }
  return 0;
}

double area_inside(const std::array<Vector3, 3>& p, const std::array<double, 3>& d, const Domain& domain,
                   double finest) {
  const double longest =
      std::sqrt(std::max({(p[1] - p[0]).squaredNorm(), (p[2] - p[1]).squaredNorm(), (p[0] - p[2]).squaredNorm()}));
  const double nearest = std::min({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])});
  if (longest <= finest || nearest > longest)
    return clipped_area(p, d);
  const std::array<Vector3, 3> middle{0.5 * (p[0] + p[1]), 0.5 * (p[1] + p[2]), 0.5 * (p[2] + p[0])};
  const std::array<double, 3> m{domain.signed_distance(middle[0]), domain.signed_distance(middle[1]),
                                domain.signed_distance(middle[2])};
  return area_inside({p[0], middle[0], middle[2]}, {d[0], m[0], m[2]}, domain, finest) +
         area_inside({middle[0], p[1], middle[1]}, {m[0], d[1], m[1]}, domain, finest) +
         area_inside({middle[2], middle[1], p[2]}, {m[2], m[1], d[2]}, domain, finest) +
         area_inside({middle[0], middle[1], middle[2]}, m, domain, finest);
}

/// A half-edge of the border.
struct LoopEdge {
  int from, to, triangle;
};

/// Loops of the border, each starting where it enters the body if it ever leaves it.
std::vector<std::vector<LoopEdge>> border_loops(const SurfaceMesh& sheet, const Neighbours& neighbours,
                                                const Domain& domain, double tolerance) {
  std::vector<LoopEdge> edges;
  std::unordered_map<int, int> leaving; // border edge that starts at a vertex
  for (int t = 0; t < std::ssize(sheet.triangles); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0) {
        leaving.emplace(sheet.triangles[t][e], static_cast<int>(edges.size()));
        edges.push_back({sheet.triangles[t][e], sheet.triangles[t][(e + 1) % 3], t});
      }
  std::vector<std::vector<LoopEdge>> loops;
  std::vector<bool> taken(edges.size(), false);
  for (int start = 0; start < std::ssize(edges); ++start) {
    if (taken[start])
      continue;
    std::vector<LoopEdge>& loop = loops.emplace_back();
    for (int e = start; !taken[e]; e = leaving.at(edges[e].to)) {
      taken[e] = true;
      loop.push_back(edges[e]);
    }
    const auto outside = std::find_if(loop.begin(), loop.end(), [&](const LoopEdge& edge) {
      return domain.signed_distance(sheet.vertices[edge.from]) >= -tolerance;
    });
    if (outside != loop.end())
      std::rotate(loop.begin(), outside, loop.end());
  }
  return loops;
}

using Interval = std::pair<double, double>;

/// Appends the parts of a + s (b - a), s in [from, to], that are deeper than `tolerance`; neighbours are joined.
class DeepParts {
 public:
  DeepParts(const Domain& domain, const Vector3& a, const Vector3& b, double tolerance)
      : domain_(domain), a_(a), b_(b), length_((b - a).norm()), tolerance_(tolerance),
        finest_(body_size(domain) / 256) {
    divide(0, depth(0), 1, depth(1));
  }
  [[nodiscard]] const std::vector<Interval>& intervals() const { return intervals_; }

 private:
  [[nodiscard]] double depth(double s) const { // positive inside
    return -tolerance_ - domain_.signed_distance(a_ + s * (b_ - a_));
  }

  void divide(double s, double at_s, double t, double at_t) {
    const bool same = (at_s > 0) == (at_t > 0);
    const double length = (t - s) * length_;
    // The distance to the surface shrinks by at most the way gone; a tenth allows for the level set of an organ.
    if (same && std::abs(at_s) + std::abs(at_t) > 1.1 * length) {
      if (at_s > 0)
        append(s, t);
      return;
    }
    if (length > finest_) {
      const double middle = 0.5 * (s + t), at_middle = depth(middle);
      divide(s, at_s, middle, at_middle);
      divide(middle, at_middle, t, at_t);
      return;
    }
    if (same) {
      if (at_s > 0)
        append(s, t);
      return;
    }
    double in = at_s > 0 ? s : t, out = at_s > 0 ? t : s;
    for (int i = 0; i < 60 && std::abs(in - out) * length_ > 1e-3 * tolerance_; ++i) {
      const double middle = 0.5 * (in + out);
      (depth(middle) > 0 ? in : out) = middle;
    }
    if (at_s > 0)
      append(s, in);
    else
      append(in, t);
  }

  void append(double s, double t) {
    if (!intervals_.empty() && intervals_.back().second >= s)
      intervals_.back().second = t;
    else
      intervals_.emplace_back(s, t);
  }

  const Domain& domain_;
  Vector3 a_, b_;
  double length_, tolerance_, finest_;
  std::vector<Interval> intervals_;
};

/// Part of the segment a b (as s in [0, 1]) within `tolerance` of the triangle; empty when first > second.
Interval within(const Vector3& a, const Vector3& b, const std::array<Vector3, 3>& p, double tolerance) {
  Interval part{0, 1};
  const auto keep_above = [&](double at_a, double at_b, double bound) {
    if (at_a < bound && at_b < bound)
      part = {1, 0};
    else if (at_a < bound)
      part.first = std::max(part.first, (bound - at_a) / (at_b - at_a));
    else if (at_b < bound)
      part.second = std::min(part.second, (at_a - bound) / (at_a - at_b));
  };
  const Vector3 normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  const double height_a = normal.dot(a - p[0]), height_b = normal.dot(b - p[0]);
  keep_above(height_a, height_b, -tolerance);
  keep_above(-height_a, -height_b, -tolerance);
  for (int e = 0; e < 3; ++e) {
    const Vector3 inward = normal.cross(p[(e + 1) % 3] - p[e]).normalized();
    keep_above(inward.dot(a - p[e]), inward.dot(b - p[e]), -tolerance);
  }
  return part;
}

/// `parts` less `removed`, leaving out pieces shorter than `shortest`.
std::vector<Interval> without(const std::vector<Interval>& parts, std::vector<Interval> removed, double shortest) {
  std::sort(removed.begin(), removed.end());
  std::vector<Interval> left;
  for (const auto& [from, to] : parts) {
    double at = from;
    for (const auto& [first, second] : removed) {
      if (second <= at || first >= to)
        continue;
      if (first - at > shortest)
        left.emplace_back(at, first);
      at = std::max(at, second);
    }
    if (to - at > shortest)
      left.emplace_back(at, to);
  }
  return left;
}

FrontEnd blend(const FrontEnd& a, const FrontEnd& b, double s) {
  FrontEnd mean;
  mean.normal = ((1 - s) * a.normal + s * b.normal).normalized();
  const Vector3 ahead = (1 - s) * a.ahead + s * b.ahead;
  mean.ahead = (ahead - ahead.dot(mean.normal) * mean.normal).normalized();
  return mean;
}

} // namespace

void check_sheet(const SurfaceMesh& sheet, const std::string& name) {
  check_elements(sheet, name);
  check_manifold(sheet, name);
}

double area_inside(const SurfaceMesh& sheet, const Domain& domain) {
  std::vector<double> distances;
  distances.reserve(sheet.vertices.size());
  for (const Vector3& x : sheet.vertices)
    distances.push_back(domain.signed_distance(x));
  const double finest = body_size(domain) / 128;
  double sum = 0;
  for (const Triangle& t : sheet.triangles)
    sum += area_inside({sheet.vertices[t[0]], sheet.vertices[t[1]], sheet.vertices[t[2]]},
                       {distances[t[0]], distances[t[1]], distances[t[2]]}, domain, finest);
  return sum;
}

bool reaches_inside(const SurfaceMesh& sheet, const Domain& domain) {
  const double tolerance = 1e-9 * body_size(domain);
  for (const Triangle& t : sheet.triangles)
    for (const int v : t)
      if (domain.signed_distance(sheet.vertices[v]) < -tolerance)
        return true;
  return area_inside(sheet, domain) > 0;
}

std::vector<FrontPiece> find_front(const std::vector<SurfaceMesh>& sheets, const std::vector<Neighbours>& neighbours,
                                   const std::vector<SheetTriangle>& triangles, const BoxTree& tree,
                                   const Domain& domain) {
  const double size = body_size(domain), surface_tolerance = 1e-9 * size;
  const double cos_corner = std::cos(40 * M_PI / 180);
  std::vector<FrontPiece> front;
  for (int s = 0; s < std::ssize(sheets); ++s) {
    const SurfaceMesh& sheet = sheets[s];
    for (const std::vector<LoopEdge>& loop : border_loops(sheet, neighbours[s], domain, surface_tolerance)) {
      const int count = static_cast<int>(loop.size());
      std::vector<FrontEnd> own(count), joint(count); // of edge i, and where edge i - 1 meets edge i
      for (int i = 0; i < count; ++i) {
        own[i].normal = triangle_normal(sheet, loop[i].triangle);
        own[i].ahead = (sheet.vertices[loop[i].to] - sheet.vertices[loop[i].from]).cross(own[i].normal).normalized();
      }
      for (int i = 0; i < count; ++i) {
        const FrontEnd &before = own[(i + count - 1) % count], &after = own[i];
        const bool corner = before.ahead.dot(after.ahead) < cos_corner || before.normal.dot(after.normal) < cos_corner;
        if (!corner)
          joint[i] = blend(before, after, 0.5);
        joint[i].corner = corner;
      }
      for (int i = 0; i < count; ++i) {
        const Vector3 &a = sheet.vertices[loop[i].from], &b = sheet.vertices[loop[i].to];
        const std::vector<Interval> deep = DeepParts(domain, a, b, surface_tolerance).intervals();
        if (deep.empty())
          continue;
        std::vector<Interval> abutted;
        // Never stops the search: every triangle near the edge is looked at.
        (void)tree.any_on_segment(a, b, [&](int place) {
          const auto [other, t] = triangles[tree.order()[place]];
          const Triangle& corners = sheets[other].triangles[t];
          if (other == s &&
              std::any_of(corners.begin(), corners.end(), [&](int v) { return v == loop[i].from || v == loop[i].to; }))
            return false;
          const Interval part = within(a, b,
                                       {sheets[other].vertices[corners[0]], sheets[other].vertices[corners[1]],
                                        sheets[other].vertices[corners[2]]},
                                       abutting * size);
          // Where borders and sheets merely cross, no length lies on both.
          if ((part.second - part.first) * (b - a).norm() > 100 * abutting * size ||
              (part.first == 0 && part.second == 1))
            abutted.push_back(part);
          return false;
        });
        const auto at_end = [&](const FrontEnd& end) { return end.corner ? own[i] : end; };
        const FrontEnd start = at_end(joint[i]), stop = at_end(joint[(i + 1) % count]);
        const double shortest = 10 * abutting * size / (b - a).norm();
        for (const auto& [from, to] : without(deep, std::move(abutted), std::min(shortest, 0.5))) {
          FrontPiece piece{{a + from * (b - a), a + to * (b - a), s}, blend(start, stop, from), blend(start, stop, to)};
          piece.from.corner = from == 0 && joint[i].corner;
          piece.to.corner = to == 1 && joint[(i + 1) % count].corner;
          front.push_back(piece);
        }
      }
    }
  }
  return front;
}

} // namespace spherecut::topology
