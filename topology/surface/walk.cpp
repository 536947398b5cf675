#include "topology/surface/walk.hpp"

#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace spherecut::topology {
namespace {

constexpr int leaf_lanes = 4;       // the lanes of a leaf
constexpr int longest_walk = 8;     // steps; over a longer way the tree is faster
constexpr float flat = 0.1F;        // half the height of a disc that is, over its radius
constexpr double same_place = 1e-9; // fraction of a segment

void check_mesh(const SurfaceMesh& mesh) {
  if (mesh.triangles.empty())
    throw InputError("contact: the surface has 0 triangles, at least 1 is needed");
  const int vertices = static_cast<int>(mesh.vertices.size());
  for (int v = 0; v < vertices; ++v)
    if (!mesh.vertices[v].allFinite())
      throw InputError(fmt::format("contact: vertex {} is ({}, {}, {}), it must be finite", v, mesh.vertices[v].x(),
                                   mesh.vertices[v].y(), mesh.vertices[v].z()));
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int v : mesh.triangles[t])
      if (v < 0 || v >= vertices)
        throw InputError(
            fmt::format("contact: triangle {} names vertex {}, it must lie in 0 .. {}", t, v, vertices - 1));
}

/// Lower bound of the distance between a box and the segment start + t direction, t in 0..1: the gap along the line
/// from the segment to the box's centre, which separates the two whenever the gap is positive.
double distance_bound(const Vector3& lower, const Vector3& upper, const Vector3& start, const Vector3& direction,
                      double inverse_length2) {
  const Vector3 centre = 0.5 * (lower + upper), half = 0.5 * (upper - lower);
  const double t = std::clamp(direction.dot(centre - start) * inverse_length2, 0.0, 1.0);
  const Vector3 gap = centre - (start + t * direction);
  const double length = gap.norm();
  return length > 0 ? length - gap.cwiseAbs().dot(half) / length : 0;
}

/// Where the segment start + t direction, t in 0..1, leaves the box; -1 when it misses it.
double exit_parameter(const Vector3& lower, const Vector3& upper, const Vector3& start, const Vector3& direction) {
  double enter = 0, exit = 1;
  for (int k = 0; k < 3; ++k) {
    const double below = lower[k] - start[k], above = upper[k] - start[k];
    if (direction[k] == 0) {
      if (below > 0 || above < 0)
        return -1;
      continue;
    }
    const double t0 = below / direction[k], t1 = above / direction[k];
    enter = std::max(enter, std::min(t0, t1));
    exit = std::min(exit, std::max(t0, t1));
  }
  return enter <= exit + 1e-12 ? exit : -1;
}

/// Children of one node still to be opened, in the order of a key: the smallest first.
template <class Key>
struct Visit {
  Key key;
  int first, count;
};

template <class Key>
class VisitStack {
 public:
  [[nodiscard]] bool empty() const { return height_ == 0; }
  Visit<Key> pop() { return open_[--height_]; }

  /// Puts children given in any order on top, the one of the smallest key last.
  void push(std::array<Visit<Key>, 4>& children, int n) {
    for (int i = 1; i < n; ++i)
      for (int j = i; j > 0 && children[j - 1].key < children[j].key; --j)
        std::swap(children[j - 1], children[j]);
    for (int i = 0; i < n; ++i)
      open_[height_++] = children[i];
  }

 private:
  std::array<Visit<Key>, 64> open_; // three a level and one; 2^31 triangles need 16 levels
  int height_ = 0;
};

} // namespace

struct SurfaceWalk::Candidate {
  double squared_distance = std::numeric_limits<double>::infinity(); // m2
  TrianglePoint at{Vector3::Zero(), TriangleFeature::face};
  int triangle = 0;
};

SurfaceWalk::SurfaceWalk(const SurfaceMesh& mesh) {
  check_mesh(mesh);
  build_tree(mesh);
  build_adjacency(mesh);
  build_leaves();
}

void SurfaceWalk::build_tree(const SurfaceMesh& mesh) {
  const int n = static_cast<int>(mesh.triangles.size());
  std::vector<Vector3> centroids(n);
  for (int t = 0; t < n; ++t) {
    const Triangle& corners = mesh.triangles[t];
    centroids[t] = (mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3;
  }
  original_.resize(n);
  std::iota(original_.begin(), original_.end(), 0);

  const BoundingBox all = bounds(mesh);
  centre_ = all.centre();
  padding_ = 4 * std::numeric_limits<float>::epsilon() * all.extent().maxCoeff();
  const auto set_box = [&](Node& node, int child, int begin, int end) {
    Vector3 lower = Vector3::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for (int i = begin; i < end; ++i)
      for (int v : mesh.triangles[original_[i]]) {
        lower = lower.cwiseMin(mesh.vertices[v] - centre_);
        upper = upper.cwiseMax(mesh.vertices[v] - centre_);
      }
    for (int k = 0; k < 3; ++k) {
      node.lower[k][child] = static_cast<float>(lower[k] - padding_);
      node.upper[k][child] = static_cast<float>(upper[k] + padding_);
    }
  };
  /// About the middle of a child's box, along the mean of its triangles' normals.
  const auto set_disc = [&](Node& node, int child, int begin, int end) {
    Vector3 normal = Vector3::Zero(), middle;
    for (int i = begin; i < end; ++i) {
      const Triangle& t = mesh.triangles[original_[i]];
      normal += (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    }
    normal = normal.squaredNorm() > 0 ? normal.stableNormalized().eval() : Vector3(Vector3::UnitZ());
    for (int k = 0; k < 3; ++k)
      middle[k] = 0.5 * (double{node.lower[k][child]} + double{node.upper[k][child]});
    const auto for_each_corner = [&](const auto& visit) {
      for (int i = begin; i < end; ++i)
        for (int v : mesh.triangles[original_[i]])
          visit(Vector3(mesh.vertices[v] - centre_ - middle));
    };
    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest, radius2 = 0;
    for_each_corner([&](const Vector3& arm) {
      const double height = normal.dot(arm);
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
      radius2 = std::max(radius2, (arm - height * normal).squaredNorm());
    });
    const Vector3 centre = middle + 0.5 * (lowest + highest) * normal;
    for (int k = 0; k < 3; ++k) {
      node.discs.centre[k][child] = static_cast<float>(centre[k]);
      node.discs.normal[k][child] = static_cast<float>(normal[k]);
    }
    node.discs.radius[child] = static_cast<float>(std::sqrt(radius2) + padding_);
    node.discs.half_height[child] = static_cast<float>(0.5 * (highest - lowest) + padding_);
    if (const float r = node.discs.radius[child]; node.discs.half_height[child] < flat * r)
      node.least_radius2 = std::min(node.least_radius2, r * r);
  };
  /// Halves the triangles begin .. end - 1 at the median of their longest extent; the middle. Leaves stay whole.
  const auto split = [&](int begin, int end) {
    if (end - begin <= leaf_lanes)
      return end;
    Vector3 lower = centroids[original_[begin]], upper = lower;
    for (int i = begin; i < end; ++i) {
      lower = lower.cwiseMin(centroids[original_[i]]);
      upper = upper.cwiseMax(centroids[original_[i]]);
    }
    Eigen::Index axis = 0;
    (upper - lower).maxCoeff(&axis);
    const int middle = begin + (end - begin + 1) / 2;
    std::nth_element(original_.begin() + begin, original_.begin() + middle, original_.begin() + end, [&](int i, int j) {
      return centroids[i][axis] < centroids[j][axis] || (centroids[i][axis] == centroids[j][axis] && i < j);
    });
    return middle;
  };

  struct Range {
    int begin, end, node;
  };
  nodes_.reserve(static_cast<std::size_t>(n) / 4 + 1);
  nodes_.emplace_back();
  std::vector<Range> open{{0, n, 0}};
  while (!open.empty()) {
    const Range range = open.back();
    open.pop_back();
    const int middle = split(range.begin, range.end);
    const std::array<int, 5> cuts{range.begin, split(range.begin, middle), middle, split(middle, range.end), range.end};
    for (int child = 0; child < 4; ++child) {
      const int begin = cuts[child], end = cuts[child + 1], count = end - begin;
      int first = -1;
      if (count > leaf_lanes) {
        first = static_cast<int>(nodes_.size());
        nodes_.emplace_back();
        open.push_back({begin, end, first});
      } else if (count > 0) {
        first = static_cast<int>(leaves_.size());
        leaves_.emplace_back().first = begin;
      }
      set_box(nodes_[range.node], child, begin, end);
      if (count > 0)
        set_disc(nodes_[range.node], child, begin, end);
      nodes_[range.node].first[child] = first;
      nodes_[range.node].count[child] = count <= leaf_lanes ? count : 0;
    }
  }

  internal_.resize(n);
  for (int i = 0; i < n; ++i)
    internal_[original_[i]] = i;
}

void SurfaceWalk::build_adjacency(const SurfaceMesh& mesh) {
  const int n = static_cast<int>(mesh.triangles.size());
  const std::vector<std::array<int, 3>> neighbours = triangle_neighbours(mesh);
  corners_.resize(n);
  vertices_of_.resize(n);
  across_.resize(n);
  face_normals_.resize(n);
  vertex_pseudonormals_.assign(mesh.vertices.size(), Vector3::Zero());
  fan_begin_.assign(mesh.vertices.size() + 1, 0);
  for (int i = 0; i < n; ++i) {
    const Triangle& triangle = mesh.triangles[original_[i]];
    vertices_of_[i] = triangle;
    corners_[i] = {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]], mesh.vertices[triangle[2]]};
    face_normals_[i] = triangle_normal(mesh, original_[i]);
    for (int k = 0; k < 3; ++k) {
      const int neighbour = neighbours[original_[i]][k];
      across_[i][k] = neighbour < 0 ? -1 : internal_[neighbour];
      const Vector3& at = mesh.vertices[triangle[k]];
      const Vector3 to_next = mesh.vertices[triangle[(k + 1) % 3]] - at,
                    to_last = mesh.vertices[triangle[(k + 2) % 3]] - at;
      const double angle = std::atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
      vertex_pseudonormals_[triangle[k]] += angle * face_normals_[i];
      ++fan_begin_[triangle[k] + 1];
    }
  }
  for (Vector3& normal : vertex_pseudonormals_)
    normal.normalize();
  std::partial_sum(fan_begin_.begin(), fan_begin_.end(), fan_begin_.begin());
  fan_.resize(3 * static_cast<std::size_t>(n));
  std::vector<int> next = fan_begin_;
  for (int i = 0; i < n; ++i)
    for (int v : vertices_of_[i])
      fan_[next[v]++] = i;
}

void SurfaceWalk::build_leaves() {
  for (std::size_t l = 0; l < leaves_.size(); ++l) {
    Leaf& leaf = leaves_[l];
    for (int lane = 0; lane < leaf_lanes; ++lane) {
      const int triangle = std::min<int>(leaf.first + lane, static_cast<int>(corners_.size()) - 1);
      const Corners& t = corners_[triangle];
      // Smallest circle around the triangle: on its longest edge, or through its corners.
      const std::array<Vector3, 3> corner{t.a, t.b, t.c};
      Vector3 centre = (t.a + t.b + t.c) / 3;
      const auto radius_about = [&](const Vector3& x) {
        return std::max({(t.a - x).norm(), (t.b - x).norm(), (t.c - x).norm()});
      };
      double radius = radius_about(centre);
      const Vector3 ab = t.b - t.a, ac = t.c - t.a, normal = ab.cross(ac);
      const Vector3 to_circumcentre =
          (ac.squaredNorm() * normal.cross(ab) + ab.squaredNorm() * ac.cross(normal)) / (2 * normal.squaredNorm());
      for (const Vector3& candidate : {Vector3(0.5 * (corner[0] + corner[1])), Vector3(0.5 * (corner[1] + corner[2])),
                                       Vector3(0.5 * (corner[2] + corner[0])), Vector3(t.a + to_circumcentre)})
        if (const double r = radius_about(candidate); r < radius) {
          radius = r;
          centre = candidate;
        }
      for (int k = 0; k < 3; ++k) {
        leaf.discs.centre[k][lane] = static_cast<float>(centre[k] - centre_[k]);
        leaf.discs.normal[k][lane] = static_cast<float>(face_normals_[triangle][k]);
      }
      leaf.discs.radius[lane] = static_cast<float>(radius + padding_);
      leaf.discs.half_height[lane] = static_cast<float>(padding_);
    }
  }
}

/// Rounding of the sums below, and of an x far from the mesh.
constexpr float rounding = 1 - 4e-6F;

inline SurfaceWalk::Lanes SurfaceWalk::squared_distance_bounds(const Node& node, const Eigen::Vector3f& x,
                                                               double best) noexcept {
  Lanes squared = Lanes::Zero();
  for (int k = 0; k < 3; ++k)
    squared += (node.lower[k] - x[k]).max(x[k] - node.upper[k]).max(0.0F).square();
  squared *= rounding;
  if (best > node.least_radius2 && squared.minCoeff() < best)
    squared = squared.max(rounding * node.discs.squared_distances(x));
  return squared;
}

double SurfaceWalk::distance_to_triangle(const Vector3& x, int triangle) const noexcept {
  const Corners& t = corners_[triangle];
  return (closest_on_triangle(x, t.a, t.b, t.c).point - x).norm();
}

inline void SurfaceWalk::try_triangle(const Vector3& x, int triangle, Candidate& best) const noexcept {
  const Corners& t = corners_[triangle];
  const TrianglePoint at = closest_on_triangle(x, t.a, t.b, t.c);
  const double squared = (at.point - x).squaredNorm();
  if (squared < best.squared_distance)
    best = {squared, at, triangle};
}

/// Steps to triangles that share the point reached so far, as long as one of them is nearer.
inline void SurfaceWalk::descend(const Vector3& x, Candidate& best) const noexcept {
  for (int step = 0; step < longest_walk; ++step) {
    const Candidate before = best;
    switch (before.at.feature) {
    case TriangleFeature::face:
      return;
    case TriangleFeature::edge_ab:
    case TriangleFeature::edge_bc:
    case TriangleFeature::edge_ca: {
      const int edge = static_cast<int>(before.at.feature) - static_cast<int>(TriangleFeature::edge_ab);
      if (const int neighbour = across_[before.triangle][edge]; neighbour >= 0)
        try_triangle(x, neighbour, best);
      break;
    }
    default: {
      const int corner = static_cast<int>(before.at.feature) - static_cast<int>(TriangleFeature::corner_a);
      const int vertex = vertices_of_[before.triangle][corner];
      for (int i = fan_begin_[vertex]; i < fan_begin_[vertex + 1]; ++i)
        try_triangle(x, fan_[i], best);
    }
    }
    if (!(best.squared_distance < before.squared_distance))
      return;
  }
}

inline Vector3 SurfaceWalk::pseudonormal(int triangle, TriangleFeature feature) const noexcept {
  switch (feature) {
  case TriangleFeature::face:
    return face_normals_[triangle];
  case TriangleFeature::edge_ab:
  case TriangleFeature::edge_bc:
  case TriangleFeature::edge_ca: {
    const int neighbour = across_[triangle][static_cast<int>(feature) - static_cast<int>(TriangleFeature::edge_ab)];
    return neighbour < 0 ? face_normals_[triangle]
                         : Vector3((face_normals_[triangle] + face_normals_[neighbour]).normalized());
  }
  default:
    return vertex_pseudonormals_[vertices_of_[triangle]
                                             [static_cast<int>(feature) - static_cast<int>(TriangleFeature::corner_a)]];
  }
}

inline WalkPoint SurfaceWalk::finish(const Vector3& x, const Candidate& best) const noexcept {
  const Vector3 normal = pseudonormal(best.triangle, best.at.feature);
  const double distance = (x - best.at.point).norm();
  return {best.at.point, normal, normal.dot(x - best.at.point) < 0 ? -distance : distance, best.triangle};
}

WalkPoint SurfaceWalk::nearest(const Vector3& x, int hint, double enough) const noexcept {
  Candidate best;
  const double enough2 = enough * enough;
  if (hint >= 0 && hint < std::ssize(corners_)) {
    try_triangle(x, hint, best);
    if (!(best.squared_distance < enough2))
      descend(x, best);
    if (best.squared_distance < enough2)
      return finish(x, best);
  }

  const Eigen::Vector3f relative = (x - centre_).cast<float>();
  VisitStack<float> stack;
  Visit<float> visit{0, 0, 0};
  for (;;) {
    if (visit.key < best.squared_distance) {
      if (visit.count > 0) {
        const Leaf& leaf = leaves_[visit.first];
        const Lanes bounds = rounding * leaf.discs.squared_distances(relative);
        for (int i = 0; i < visit.count; ++i)
          if (bounds[i] < best.squared_distance)
            try_triangle(x, leaf.first + i, best);
      } else {
        const Node& node = nodes_[visit.first];
        const Lanes squared = squared_distance_bounds(node, relative, best.squared_distance);
        std::array<Visit<float>, 4> children;
        int n = 0;
        for (int child = 0; child < 4; ++child)
          if (squared[child] < best.squared_distance)
            children[n++] = {squared[child], node.first[child], node.count[child]};
        stack.push(children, n);
      }
    }
    if (stack.empty() || best.squared_distance < enough2)
      break;
    visit = stack.pop();
  }
  return finish(x, best);
}

WalkPoint SurfaceWalk::nearest_among(const Vector3& x, std::span<const int> triangles) const noexcept {
  Candidate best;
  best.triangle = triangles.front();
  for (const int triangle : triangles)
    try_triangle(x, triangle, best);
  return finish(x, best);
}

NearestToSegment SurfaceWalk::nearest_to_segment_among(const Vector3& start, const Vector3& end, double within,
                                                       std::span<const int> triangles) const noexcept {
  NearestToSegment best{within, 0, -1};
  for (const int triangle : triangles) {
    const Corners& t = corners_[triangle];
    const SegmentPair pair = closest_segment_triangle(start, end, t.a, t.b, t.c);
    if (pair.distance < best.distance)
      best = {pair.distance, pair.along, triangle};
  }
  return best;
}

NearestToSegment SurfaceWalk::nearest_to_segment(const Vector3& start, const Vector3& end, double within,
                                                 int hint) const noexcept {
  const std::array<int, 1> first{hint >= 0 && hint < std::ssize(corners_) ? hint : 0};
  NearestToSegment best = nearest_to_segment_among(start, end, within, first);
  const Vector3 direction = end - start;
  const double length2 = direction.squaredNorm(), inverse_length2 = length2 > 0 ? 1 / length2 : 0;

  VisitStack<double> stack;
  Visit<double> visit{0, 0, 0};
  for (;;) {
    if (visit.key < best.distance) {
      for (int i = 0; i < visit.count; ++i) {
        const std::array<int, 1> one{leaves_[visit.first].first + i};
        const NearestToSegment found = nearest_to_segment_among(start, end, best.distance, one);
        if (found.triangle >= 0)
          best = found;
      }
      if (visit.count == 0) {
        const Node& node = nodes_[visit.first];
        std::array<Visit<double>, 4> children;
        int n = 0;
        for (int child = 0; child < 4; ++child)
          if (node.first[child] >= 0)
            if (const double bound = distance_bound(node.box_lower(child), node.box_upper(child), start - centre_,
                                                    direction, inverse_length2);
                bound < best.distance)
              children[n++] = {bound, node.first[child], node.count[child]};
        stack.push(children, n);
      }
    }
    if (stack.empty())
      return best;
    visit = stack.pop();
  }
}

/// Where two triangles are crossed at the same place (their common edge), the one that is entered counts: callers then
/// look further instead of taking the rest of the segment to lie outside.
inline void SurfaceWalk::keep_crossing(const Vector3& start, const Vector3& end, int triangle,
                                       LastCrossing& last) const noexcept {
  const Corners& t = corners_[triangle];
  const Crossing crossing = segment_crosses_triangle(start, end, t.a, t.b, t.c);
  if (!crossing.found)
    return;
  const bool leaves = face_normals_[triangle].dot(end - start) > 0;
  if (last.triangle < 0 || crossing.along > last.along + same_place ||
      (crossing.along > last.along - same_place && !leaves))
    last = {std::max(crossing.along, last.along), triangle, leaves};
}

LastCrossing SurfaceWalk::last_crossing_among(const Vector3& start, const Vector3& end,
                                              std::span<const int> triangles) const noexcept {
  LastCrossing last;
  for (const int triangle : triangles)
    keep_crossing(start, end, triangle, last);
  return last;
}

LastCrossing SurfaceWalk::last_crossing(const Vector3& start, const Vector3& end) const noexcept {
  LastCrossing last;
  const Vector3 direction = end - start;
  VisitStack<double> stack; // the farthest exit first
  Visit<double> visit{-1, 0, 0};
  for (;;) {
    if (-visit.key > last.along - same_place) {
      for (int i = 0; i < visit.count; ++i)
        keep_crossing(start, end, leaves_[visit.first].first + i, last);
      if (visit.count == 0) {
        const Node& node = nodes_[visit.first];
        std::array<Visit<double>, 4> children;
        int n = 0;
        for (int child = 0; child < 4; ++child)
          if (node.first[child] >= 0)
            if (const double exit =
                    exit_parameter(node.box_lower(child), node.box_upper(child), start - centre_, direction);
                exit >= 0)
              children[n++] = {-exit, node.first[child], node.count[child]};
        stack.push(children, n);
      }
    }
    if (stack.empty())
      return last;
    visit = stack.pop();
  }
}

Vector3 SurfaceWalk::smooth_normal(const WalkPoint& at) const noexcept {
  const Corners& t = corners_[at.triangle];
  const Vector3 ab = t.b - t.a, ac = t.c - t.a, ap = at.point - t.a, normal = ab.cross(ac);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0))
    return at.normal;
  const double v = normal.dot(ap.cross(ac)) / area2, w = normal.dot(ab.cross(ap)) / area2;
  const Triangle& vertices = vertices_of_[at.triangle];
  const Vector3 sum = (1 - v - w) * vertex_pseudonormals_[vertices[0]] + v * vertex_pseudonormals_[vertices[1]] +
                      w * vertex_pseudonormals_[vertices[2]];
  const double length = sum.norm();
  return length > 0 ? Vector3(sum / length) : at.normal;
}

} // namespace spherecut::topology
