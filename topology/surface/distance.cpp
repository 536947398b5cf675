#include "topology/surface/distance.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>
#include <utility>

namespace spherecut::topology {

namespace {

/// A node of the box tree; the first child follows it in the array. Single precision, rounded outwards: half the
/// memory traffic, which is what a query spends its time on.
struct Node {
  std::array<float, 3> lower;
  int count; // triangles of a leaf, 0 for an inner node
  std::array<float, 3> upper;
  int next; // inner node: second child; leaf: first place in tree order
};

constexpr int triangles_in_leaf = 8;

/// Lower bound of the squared distance from x to anything in the node.
double squared_bound(const Node& node, const Vector3& x) {
  const auto gap = [&](int d) { return std::max(std::max(node.lower[d] - x[d], x[d] - node.upper[d]), 0.0); };
  const double u = gap(0), v = gap(1), w = gap(2);
  return u * u + v * v + w * w;
}

float below(double value) {
  return std::nextafter(static_cast<float>(value), -std::numeric_limits<float>::infinity());
}
float above(double value) {
  return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::infinity());
}

/// A disc in the triangle's plane that covers it. At a depth of several triangles the boxes of oblique triangles all
/// reach nearer than the surface does; the disc does not, and costs a fifth of the exact closest point.
struct Disc {
  Vector3 centre; // m
  Vector3 normal; // unit
  double radius;  // m
};

/// Lower bound of the squared distance from x to the disc, with an allowance for rounding.
double squared_bound(const Disc& disc, const Vector3& x) {
  const Vector3 from_centre = x - disc.centre;
  const double height = from_centre.dot(disc.normal);
  const double lateral = std::sqrt(std::max(0.0, from_centre.squaredNorm() - height * height));
  const double beside = std::max(0.0, lateral - disc.radius);
  constexpr double rounding = 1e-9;
  return (1 - rounding) * (height * height + beside * beside);
}

using Corners = std::array<Vector3, 3>;

Disc cover(const Corners& p, const Vector3& normal) {
  const Vector3 centre = (p[0] + p[1] + p[2]) / 3;
  double radius = 0;
  for (const Vector3& corner : p)
    radius = std::max(radius, (corner - centre).norm());
  return {centre, normal, radius * (1 + 1e-9)};
}

/// Closest point of a triangle, and the part of the triangle it lies on.
struct OnTriangle {
  Vector3 point;
  enum class Part { face, edge, vertex } part;
  int local; // edge e joins corners e and e + 1; or the corner
};

/// Voronoi regions of a triangle [Ericson 2005, sec. 5.1.5].
OnTriangle closest_on_triangle(const Vector3& x, const Corners& corners) {
  const auto& [a, b, c] = corners;
  using Part = OnTriangle::Part;
  const Vector3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const double ab_ax = ab.dot(ax), ac_ax = ac.dot(ax);
  if (ab_ax <= 0 && ac_ax <= 0)
    return {a, Part::vertex, 0};
  const double ab_bx = ab.dot(bx), ac_bx = ac.dot(bx);
  if (ab_bx >= 0 && ac_bx <= ab_bx)
    return {b, Part::vertex, 1};
  const double ab_cx = ab.dot(cx), ac_cx = ac.dot(cx);
  if (ac_cx >= 0 && ab_cx <= ac_cx)
    return {c, Part::vertex, 2};
  const double area_c = ab_ax * ac_bx - ab_bx * ac_ax;
  if (area_c <= 0 && ab_ax >= 0 && ab_bx <= 0)
    return {a + ab_ax / (ab_ax - ab_bx) * ab, Part::edge, 0};
  const double area_a = ab_bx * ac_cx - ab_cx * ac_bx;
  const double along_bc = ac_bx - ab_bx, back_from_c = ab_cx - ac_cx;
  if (area_a <= 0 && along_bc >= 0 && back_from_c >= 0)
    return {b + along_bc / (along_bc + back_from_c) * (c - b), Part::edge, 1};
  const double area_b = ab_cx * ac_ax - ab_ax * ac_cx;
  if (area_b <= 0 && ac_ax >= 0 && ac_cx <= 0)
    return {a + ac_ax / (ac_ax - ac_cx) * ac, Part::edge, 2};
  const double sum = area_a + area_b + area_c;
  return {a + (area_b / sum) * ab + (area_c / sum) * ac, Part::face, 0};
}

void require_closed(const SurfaceMesh& mesh) {
  if (mesh.triangles.empty())
    throw InputError("surface has no triangles");
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (const int v : mesh.triangles[t])
      if (v < 0 || v >= std::ssize(mesh.vertices))
        throw InputError(
            fmt::format("triangle {} refers to vertex {}: the surface has {} vertices", t, v, mesh.vertices.size()));
  for (int v = 0; v < std::ssize(mesh.vertices); ++v)
    if (!mesh.vertices[v].allFinite())
      throw InputError(fmt::format("vertex {} is not finite", v));
  const auto neighbours = triangle_neighbours(mesh);
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0)
        throw InputError(fmt::format("surface is open or inconsistently oriented at triangle {}, edge {} to {}", t,
                                     mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3]));
}

} // namespace

struct SurfaceDistance::Impl {
  explicit Impl(const SurfaceMesh& mesh) : triangles(mesh.triangles), neighbours(triangle_neighbours(mesh)) {
    const int count = static_cast<int>(triangles.size());
    face_normals.reserve(count);
    vertex_pseudonormals.assign(mesh.vertices.size(), Vector3::Zero());
    for (int t = 0; t < count; ++t) {
      const Triangle& corners = triangles[t];
      const Corners p = {mesh.vertices[corners[0]], mesh.vertices[corners[1]], mesh.vertices[corners[2]]};
      const Vector3 area_vector = (p[1] - p[0]).cross(p[2] - p[0]);
      if (area_vector.squaredNorm() == 0)
        throw InputError(
            fmt::format("triangle {} (vertices {}, {}, {}) has no area", t, corners[0], corners[1], corners[2]));
      face_normals.push_back(area_vector.normalized());
      for (int c = 0; c < 3; ++c) {
        const Vector3 u = p[(c + 1) % 3] - p[c], v = p[(c + 2) % 3] - p[c];
        vertex_pseudonormals[corners[c]] += std::atan2(u.cross(v).norm(), u.dot(v)) * face_normals.back();
      }
    }
    tree_order.resize(count);
    std::iota(tree_order.begin(), tree_order.end(), 0);
    std::vector<Vector3> centres(count);
    for (int t = 0; t < count; ++t)
      centres[t] =
          (mesh.vertices[triangles[t][0]] + mesh.vertices[triangles[t][1]] + mesh.vertices[triangles[t][2]]) / 3;
    nodes.reserve(count);
    build(mesh, centres, 0, count);
    corners_in_order.reserve(count);
    discs_in_order.reserve(count);
    place.resize(count);
    for (int i = 0; i < count; ++i) {
      const Triangle& t = triangles[tree_order[i]];
      corners_in_order.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
      discs_in_order.push_back(cover(corners_in_order.back(), face_normals[tree_order[i]]));
      place[tree_order[i]] = i;
    }
  }

  /// Builds the subtree of tree_order[first, last) by median splits of the triangle centres.
  void build(const SurfaceMesh& mesh, const std::vector<Vector3>& centres, int first, int last) {
    const std::size_t self = nodes.size();
    Vector3 lower = Vector3::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for (int i = first; i < last; ++i)
      for (const int v : triangles[tree_order[i]]) {
        lower = lower.cwiseMin(mesh.vertices[v]);
        upper = upper.cwiseMax(mesh.vertices[v]);
      }
    nodes.push_back({{below(lower.x()), below(lower.y()), below(lower.z())},
                     last - first,
                     {above(upper.x()), above(upper.y()), above(upper.z())},
                     first});
    if (last - first <= triangles_in_leaf)
      return;
    Vector3 lower_centre = centres[tree_order[first]], upper_centre = lower_centre;
    for (int i = first + 1; i < last; ++i) {
      lower_centre = lower_centre.cwiseMin(centres[tree_order[i]]);
      upper_centre = upper_centre.cwiseMax(centres[tree_order[i]]);
    }
    Eigen::Index axis = 0;
    (upper_centre - lower_centre).maxCoeff(&axis);
    const int middle = (first + last) / 2;
    // Ties are broken by the index, so that the tree does not depend on the library's algorithm.
    std::nth_element(tree_order.begin() + first, tree_order.begin() + middle, tree_order.begin() + last,
                     [&](int a, int b) { return std::pair(centres[a][axis], a) < std::pair(centres[b][axis], b); });
    nodes[self].count = 0;
    build(mesh, centres, first, middle);
    nodes[self].next = static_cast<int>(nodes.size());
    build(mesh, centres, middle, last);
  }

  /// Triangle (by its place in the tree) nearest to x, and the point on it. Starts from the triangle at `start`.
  [[nodiscard]] std::pair<int, OnTriangle> search(const Vector3& x, int start) const {
    int best = start;
    OnTriangle best_point = closest_on_triangle(x, corners_in_order[start]);
    double best_squared = (x - best_point.point).squaredNorm();
    struct Postponed {
      int node;
      double squared;
    };
    // Median splits keep the depth under 32 for any number of triangles an int can count.
    std::array<Postponed, 64> stack;
    int height = 0;
    stack[height++] = {0, squared_bound(nodes[0], x)};
    while (height > 0) {
      auto [index, squared] = stack[--height];
      if (squared >= best_squared)
        continue;
      while (nodes[index].count == 0) {
        int nearer = index + 1, farther = nodes[index].next;
        double nearer_squared = squared_bound(nodes[nearer], x);
        double farther_squared = squared_bound(nodes[farther], x);
        if (farther_squared < nearer_squared) {
          std::swap(nearer, farther);
          std::swap(nearer_squared, farther_squared);
        }
        if (farther_squared < best_squared)
          stack[height++] = {farther, farther_squared};
        index = nearer;
        squared = nearer_squared;
        if (squared >= best_squared)
          break;
      }
      if (squared >= best_squared)
        continue;
      for (int i = nodes[index].next; i < nodes[index].next + nodes[index].count; ++i) {
        if (squared_bound(discs_in_order[i], x) >= best_squared)
          continue;
        const OnTriangle candidate = closest_on_triangle(x, corners_in_order[i]);
        const double candidate_squared = (x - candidate.point).squaredNorm();
        if (candidate_squared < best_squared) {
          best_squared = candidate_squared;
          best_point = candidate;
          best = i;
        }
      }
    }
    return {best, best_point};
  }

  [[nodiscard]] Vector3 pseudonormal(int triangle, const OnTriangle& at) const {
    switch (at.part) {
    case OnTriangle::Part::vertex:
      return vertex_pseudonormals[triangles[triangle][at.local]];
    case OnTriangle::Part::edge:
      return face_normals[triangle] + face_normals[neighbours[triangle][at.local]];
    case OnTriangle::Part::face:
      break;
    }
    return face_normals[triangle];
  }

  std::vector<Triangle> triangles;
  std::vector<std::array<int, 3>> neighbours;
  std::vector<Vector3> face_normals;         // unit
  std::vector<Vector3> vertex_pseudonormals; // sum of angle x unit normal
  std::vector<Node> nodes;
  std::vector<int> tree_order; // triangle at each place of the tree
  std::vector<int> place;      // place of each triangle in the tree
  std::vector<Corners> corners_in_order;
  std::vector<Disc> discs_in_order;
};

SurfaceDistance::SurfaceDistance(const SurfaceMesh& mesh) {
  require_closed(mesh);
  impl_ = std::make_unique<Impl>(mesh);
}
SurfaceDistance::~SurfaceDistance() = default;
SurfaceDistance::SurfaceDistance(SurfaceDistance&&) noexcept = default;
SurfaceDistance& SurfaceDistance::operator=(SurfaceDistance&&) noexcept = default;

NearestPoint SurfaceDistance::nearest(const Vector3& x, int hint) const {
  const Impl& impl = *impl_;
  const int start = hint >= 0 && hint < std::ssize(impl.place) ? impl.place[hint] : 0;
  const auto [place, at] = impl.search(x, start);
  NearestPoint result;
  result.triangle = impl.tree_order[place];
  result.point = at.point;
  const Vector3 pseudonormal = impl.pseudonormal(result.triangle, at);
  const Vector3 away = x - at.point;
  const double distance = away.norm();
  const double sign = away.dot(pseudonormal) < 0 ? -1 : 1;
  result.distance = sign * distance;
  // Within rounding of the surface the direction to it is noise; the pseudonormal is what it tends to.
  const double rounding = 1e-12 * (x.cwiseAbs().maxCoeff() + distance);
  result.normal = distance > rounding ? Vector3(away * (sign / distance)) : pseudonormal.normalized();
  return result;
}

} // namespace spherecut::topology
