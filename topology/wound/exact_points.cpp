#include "topology/wound/exact_points.hpp"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Constrained_triangulation_face_base_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>
#include <unordered_map>

namespace spherecut::topology {

namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Rational = Kernel::Exact_kernel::FT;
using Exact3 = std::array<Rational, 3>;

struct PointNumber {
  int value = -1;
};
struct FaceNumber {
  int value = -1;
};
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<PointNumber, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceNumber, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Triangulation =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>,
                                               CGAL::No_constraint_intersection_requiring_constructions_tag>;

constexpr double unit_rounding = 0x1p-52;

int sign(const Rational& x) {
  return static_cast<int>(CGAL::sign(x));
}

int sign(double x) {
  return (x > 0) - (x < 0);
}

Exact3 difference(const Exact3& a, const Exact3& b) {
  return {Rational(a[0] - b[0]), Rational(a[1] - b[1]), Rational(a[2] - b[2])};
}

Exact3 cross(const Exact3& a, const Exact3& b) {
  return {Rational(a[1] * b[2] - a[2] * b[1]), Rational(a[2] * b[0] - a[0] * b[2]),
          Rational(a[0] * b[1] - a[1] * b[0])};
}

Rational dot(const Exact3& a, const Exact3& b) {
  return Rational(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

/// p + share (q - p).
Exact3 between(const Exact3& p, const Exact3& q, const Rational& share) {
  return {Rational(p[0] + share * (q[0] - p[0])), Rational(p[1] + share * (q[1] - p[1])),
          Rational(p[2] + share * (q[2] - p[2]))};
}

std::uint64_t hash_of(const Vector3& x) {
  std::uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis)
    hash = (hash ^ std::bit_cast<std::uint64_t>(x[axis])) * 0x9E3779B97F4A7C15ULL + (hash >> 29);
  return hash;
}

} // namespace

struct ExactPoints::Data {
  std::vector<Vector3> positions;
  std::vector<int> exact_index; // into exact; -1: the position is exact
  std::vector<Exact3> exact;
  std::unordered_map<std::uint64_t, std::vector<int>> by_position;
  std::map<std::array<int, 5>, int> passages; // edge_plane results by the numbers of edge and triangle

  [[nodiscard]] Exact3 exact_of(int p) const {
    if (exact_index[p] >= 0)
      return exact[exact_index[p]];
    const Vector3& x = positions[p];
    return {Rational(x[0]), Rational(x[1]), Rational(x[2])};
  }

  int insert(const Vector3& x, const Exact3* coordinates) {
    std::vector<int>& alike = by_position[hash_of(x)];
    for (const int p : alike)
      if (positions[p] == x) {
        if (coordinates == nullptr ? exact_index[p] < 0 : exact_index[p] >= 0 && exact[exact_index[p]] == *coordinates)
          return p;
      }
    const int point = static_cast<int>(positions.size());
    positions.push_back(x);
    exact_index.push_back(coordinates == nullptr ? -1 : static_cast<int>(exact.size()));
    if (coordinates != nullptr)
      exact.push_back(*coordinates);
    alike.push_back(point);
    return point;
  }

  int insert(const Exact3& coordinates) {
    const Vector3 x = Vector3(CGAL::to_double(coordinates[0]), CGAL::to_double(coordinates[1]),
                              CGAL::to_double(coordinates[2])) +
                      Vector3::Zero(); // no negative zeros
    const bool representable =
        Rational(x[0]) == coordinates[0] && Rational(x[1]) == coordinates[1] && Rational(x[2]) == coordinates[2];
    return insert(x, representable ? nullptr : &coordinates);
  }

  [[nodiscard]] Kernel::Point_2 project(int p, int axis) const {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (exact_index[p] < 0)
      return {Kernel::FT(positions[p][u]), Kernel::FT(positions[p][v])};
    const Exact3& x = exact[exact_index[p]];
    return {Kernel::FT(x[u]), Kernel::FT(x[v])};
  }
};

ExactPoints::ExactPoints() : data_(std::make_unique<Data>()) {}
ExactPoints::~ExactPoints() = default;

int ExactPoints::add(const Vector3& x) {
  return data_->insert(x + Vector3::Zero(), nullptr);
}

int ExactPoints::edge_plane(int p, int q, const Triangle& triangle) {
  Triangle sorted = triangle;
  std::sort(sorted.begin(), sorted.end());
  const auto [known, fresh] =
      data_->passages.emplace(std::array{std::min(p, q), std::max(p, q), sorted[0], sorted[1], sorted[2]}, -1);
  if (!fresh)
    return known->second;
  const Exact3 a = data_->exact_of(triangle[0]), from = data_->exact_of(p), to = data_->exact_of(q);
  const Exact3 normal = cross(difference(data_->exact_of(triangle[1]), a), difference(data_->exact_of(triangle[2]), a));
  const Rational hp = dot(normal, difference(from, a)), hq = dot(normal, difference(to, a));
  return known->second = data_->insert(between(from, to, Rational(hp / (hp - hq))));
}

int ExactPoints::edge_edge(int p, int q, int r, int s, int axis) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Exact3 a = data_->exact_of(r), along = difference(data_->exact_of(s), a);
  const Exact3 from = data_->exact_of(p), to = data_->exact_of(q);
  const Exact3 x = difference(from, a), y = difference(to, a);
  const Rational hp(along[u] * x[v] - along[v] * x[u]), hq(along[u] * y[v] - along[v] * y[u]);
  return data_->insert(between(from, to, Rational(hp / (hp - hq))));
}

int ExactPoints::centroid(const Triangle& triangle) {
  const Exact3 a = data_->exact_of(triangle[0]), b = data_->exact_of(triangle[1]), c = data_->exact_of(triangle[2]);
  const Rational three(3);
  return data_->insert(Exact3{Rational((a[0] + b[0] + c[0]) / three), Rational((a[1] + b[1] + c[1]) / three),
                              Rational((a[2] + b[2] + c[2]) / three)});
}

int ExactPoints::count() const {
  return static_cast<int>(data_->positions.size());
}

const Vector3& ExactPoints::position(int point) const {
  return data_->positions[point];
}

int ExactPoints::orientation(int p, int q, int r, int s) const {
  if (p == q || p == r || p == s || q == r || q == s || r == s)
    return 0;
  const Vector3 &x = position(p), a = position(q) - x, b = position(r) - x, c = position(s) - x;
  const double determinant = a.cross(b).dot(c);
  // Coordinates are rounded by one unit each; the bound covers that and the arithmetic five times over.
  const double size = std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
  const double bound = 512 * unit_rounding * (x.cwiseAbs().maxCoeff() + size) * size * size;
  if (std::abs(determinant) > bound)
    return sign(determinant);
  const Exact3 o = data_->exact_of(p);
  return sign(dot(cross(difference(data_->exact_of(q), o), difference(data_->exact_of(r), o)),
                  difference(data_->exact_of(s), o)));
}

int ExactPoints::turn(int p, int q, int r, int axis) const {
  if (p == q || q == r || r == p)
    return 0;
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vector3 &x = position(p), a = position(q) - x, b = position(r) - x;
  const double determinant = a[u] * b[v] - a[v] * b[u];
  const double size = std::max(a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff());
  if (std::abs(determinant) > 256 * unit_rounding * (x.cwiseAbs().maxCoeff() + size) * size)
    return sign(determinant);
  const Exact3 o = data_->exact_of(p), e = difference(data_->exact_of(q), o), f = difference(data_->exact_of(r), o);
  return sign(Rational(e[u] * f[v] - e[v] * f[u]));
}

int ExactPoints::same_side(int u, int v, int r, int s) const {
  const Vector3 &x = position(u), t = position(v) - x, a = position(r) - x, b = position(s) - x;
  const double product = t.cross(a).dot(t.cross(b));
  const double size = std::max({t.cwiseAbs().maxCoeff(), a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff()});
  if (std::abs(product) > 2048 * unit_rounding * (x.cwiseAbs().maxCoeff() + size) * size * size * size)
    return sign(product);
  const Exact3 o = data_->exact_of(u), along = difference(data_->exact_of(v), o);
  return sign(dot(cross(along, difference(data_->exact_of(r), o)), cross(along, difference(data_->exact_of(s), o))));
}

int ExactPoints::compare(int p, int q) const {
  if (p == q)
    return 0;
  // Rounding keeps the order.
  const Vector3 &x = position(p), &y = position(q);
  if (x[0] != y[0])
    return x[0] < y[0] ? -1 : 1;
  const Exact3 a = data_->exact_of(p), b = data_->exact_of(q);
  for (int axis = 0; axis < 3; ++axis)
    if (a[axis] != b[axis])
      return a[axis] < b[axis] ? -1 : 1;
  return 0;
}

bool ExactPoints::collinear(int p, int q, int r) const {
  return turn(p, q, r, 0) == 0 && turn(p, q, r, 1) == 0 && turn(p, q, r, 2) == 0;
}

int ExactPoints::widest_axis(const Triangle& triangle) const {
  const Vector3 &x = position(triangle[0]), a = position(triangle[1]) - x, b = position(triangle[2]) - x;
  const Vector3 normal = a.cross(b).cwiseAbs();
  Eigen::Index widest = 0;
  const double largest = normal.maxCoeff(&widest);
  const double size = std::max(a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff());
  const double bound = 256 * unit_rounding * (x.cwiseAbs().maxCoeff() + size) * size;
  if (largest - normal[(widest + 1) % 3] > bound && largest - normal[(widest + 2) % 3] > bound)
    return static_cast<int>(widest);
  const Exact3 o = data_->exact_of(triangle[0]);
  const Exact3 n = cross(difference(data_->exact_of(triangle[1]), o), difference(data_->exact_of(triangle[2]), o));
  int best = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (CGAL::abs(n[axis]) > CGAL::abs(n[best]))
      best = axis;
  return best;
}

std::vector<int> ExactPoints::crossings(const std::vector<std::pair<int, int>>& segments, int axis) {
  // Sweep along one coordinate: rounding keeps its order.
  const int along = (axis + 1) % 3;
  struct Span {
    double from, to; // m
    int p, q;
  };
  std::vector<Span> spans;
  spans.reserve(segments.size());
  for (const auto& [p, q] : segments) {
    const auto [from, to] = std::minmax(position(p)[along], position(q)[along]);
    spans.push_back({from, to, p, q});
  }
  std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.from < b.from; });
  std::vector<int> found;
  for (std::size_t i = 0; i < spans.size(); ++i)
    for (std::size_t j = i + 1; j < spans.size() && spans[j].from <= spans[i].to; ++j) {
      const auto [p, q] = std::pair(spans[i].p, spans[i].q);
      const auto [r, s] = std::pair(spans[j].p, spans[j].q);
      if (p == r || p == s || q == r || q == s)
        continue;
      if (turn(p, q, r, axis) * turn(p, q, s, axis) < 0 && turn(r, s, p, axis) * turn(r, s, q, axis) < 0)
        found.push_back(edge_edge(p, q, r, s, axis));
    }
  return found;
}

std::vector<Triangle> ExactPoints::triangulate(const Triangle& triangle,
                                               const std::vector<std::pair<int, int>>& segments,
                                               const std::vector<int>& points) {
  const int axis = widest_axis(triangle);
  Triangulation plane;
  std::map<int, Triangulation::Vertex_handle> vertices;
  const auto vertex = [&](int point) {
    const auto [found, fresh] = vertices.emplace(point, nullptr);
    if (fresh) {
      found->second = plane.insert(data_->project(point, axis));
      found->second->info().value = point;
    }
    return found->second;
  };
  for (const int corner : triangle)
    vertex(corner);
  for (const int point : points)
    vertex(point);
  for (const int point : crossings(segments, axis))
    vertex(point);
  for (const auto& [from, to] : segments)
    plane.insert_constraint(vertex(from), vertex(to));

  std::vector<Triangulation::Face_handle> faces;
  for (const Triangulation::Face_handle face : plane.finite_face_handles()) {
    face->info().value = static_cast<int>(faces.size());
    faces.push_back(face);
  }
  // Faces that share a circle across an edge that is no constraint belong together.
  std::vector<int> group(faces.size());
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int f) {
    while (group[f] != f)
      f = group[f];
    return f;
  };
  bool grouped = false;
  for (int f = 0; f < std::ssize(faces); ++f)
    for (int e = 0; e < 3; ++e) {
      const Triangulation::Face_handle other = faces[f]->neighbor(e);
      if (plane.is_infinite(other) || other->info().value < f || faces[f]->is_constrained(e))
        continue;
      const Kernel::Point_2& beyond = other->vertex(other->index(faces[f]))->point();
      if (plane.side_of_oriented_circle(faces[f], beyond, true) == CGAL::ON_ORIENTED_BOUNDARY) {
        group[root(other->info().value)] = root(f);
        grouped = true;
      }
    }

  const bool flipped = turn(triangle[0], triangle[1], triangle[2], axis) < 0;
  std::vector<Triangle> result;
  result.reserve(faces.size());
  const auto emit = [&](int a, int b, int c) { result.push_back(flipped ? Triangle{a, c, b} : Triangle{a, b, c}); };
  const auto number = [](Triangulation::Face_handle face, int i) { return face->vertex(i)->info().value; };
  std::vector<std::vector<int>> members(grouped ? faces.size() : 0);
  for (int f = 0; f < std::ssize(faces); ++f) {
    if (grouped)
      members[root(f)].push_back(f);
    else
      emit(number(faces[f], 0), number(faces[f], 1), number(faces[f], 2));
  }
  for (const std::vector<int>& together : members) {
    if (together.size() == 1) {
      const Triangulation::Face_handle face = faces[together.front()];
      emit(number(face, 0), number(face, 1), number(face, 2));
    }
    if (together.size() < 2)
      continue;
    std::map<int, int> next; // around the polygon, counter-clockwise
    for (const int f : together)
      for (int e = 0; e < 3; ++e) {
        const Triangulation::Face_handle other = faces[f]->neighbor(e);
        if (plane.is_infinite(other) || root(other->info().value) != root(f) || faces[f]->is_constrained(e))
          next[number(faces[f], (e + 1) % 3)] = number(faces[f], (e + 2) % 3);
      }
    int apex = next.begin()->first;
    for (const auto& [point, following] : next)
      if (compare(point, apex) < 0)
        apex = point;
    for (int a = next.at(apex), b = next.at(a); b != apex; a = b, b = next.at(a))
      emit(apex, a, b);
  }
  return result;
}

} // namespace spherecut::topology
