#include "topology/search/box_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace spherecut::topology {

namespace {
constexpr int leaf_size = 2;

std::vector<BoundingBox> boxes_of(const std::vector<std::array<Vector3, 3>>& triangles, double margin) {
  std::vector<BoundingBox> boxes;
  boxes.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles)
    boxes.push_back({a.cwiseMin(b).cwiseMin(c).array() - margin, a.cwiseMax(b).cwiseMax(c).array() + margin});
  return boxes;
}
} // namespace

BoxTree::BoxTree(const std::vector<BoundingBox>& boxes) : BoxTree(boxes, {}, 0) {}

BoxTree::BoxTree(const std::vector<std::array<Vector3, 3>>& triangles, double margin)
    : BoxTree(boxes_of(triangles, margin), triangles, margin) {}

BoxTree::BoxTree(const std::vector<BoundingBox>& boxes, const std::vector<std::array<Vector3, 3>>& triangles,
                 double margin)
    : order_(boxes.size()), margin_(margin) {
  if (boxes.empty())
    return;
  bounds_ = boxes.front();
  std::vector<Vector3> centres;
  centres.reserve(boxes.size());
  for (const BoundingBox& box : boxes) {
    bounds_.lower = bounds_.lower.cwiseMin(box.lower);
    bounds_.upper = bounds_.upper.cwiseMax(box.upper);
    centres.push_back(box.centre());
  }
  origin_ = bounds_.centre();
  rounding_ = 3e-7F * static_cast<float>(bounds_.extent().maxCoeff());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(boxes.size() / 2 + 1);
  build(boxes, triangles, centres, 0, static_cast<int>(boxes.size()));
}

/// Halves order_[first, last) by the median along the longest side of the centres' box; the place between.
int BoxTree::halve(const std::vector<Vector3>& centres, int first, int last) {
  Vector3 lower = centres[order_[first]], upper = lower;
  for (int i = first + 1; i < last; ++i) {
    lower = lower.cwiseMin(centres[order_[i]]);
    upper = upper.cwiseMax(centres[order_[i]]);
  }
  Eigen::Index axis = 0;
  (upper - lower).maxCoeff(&axis);
  const int middle = (first + last) / 2;
  // Ties are broken by the index, so that the tree does not depend on the library's algorithm.
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) { return std::pair(centres[a][axis], a) < std::pair(centres[b][axis], b); });
  return middle;
}

/// Node over order_[first, last), depth first; its index.
int BoxTree::build(const std::vector<BoundingBox>& boxes, const std::vector<std::array<Vector3, 3>>& triangles,
                   const std::vector<Vector3>& centres, int first, int last) {
  const int self = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  std::array<int, 5> cut{first, last, last, last, last};
  int parts = 1;
  while (parts < 4) { // halve the largest part
    int largest = 0;
    for (int p = 1; p < parts; ++p)
      if (cut[p + 1] - cut[p] > cut[largest + 1] - cut[largest])
        largest = p;
    if (cut[largest + 1] - cut[largest] <= leaf_size)
      break;
    const int middle = halve(centres, cut[largest], cut[largest + 1]);
    for (int p = ++parts; p > largest + 1; --p)
      cut[p] = cut[p - 1];
    cut[largest + 1] = middle;
  }
  Node node;
  for (int d = 0; d < 3; ++d) {
    node.boxes.centre[d].setZero();
    node.boxes.half[d].setZero();
    for (Slabs& slabs : node.slabs)
      slabs.across[d].setZero();
  }
  for (Slabs& slabs : node.slabs) {
    slabs.height.setZero();
    slabs.thickness.setConstant(std::numeric_limits<float>::infinity());
  }
  node.first.fill(0);
  node.count.fill(0);
  node.children = parts;
  for (int p = 0; p < parts; ++p) {
    Vector3 lower = boxes[order_[cut[p]]].lower, upper = boxes[order_[cut[p]]].upper;
    for (int i = cut[p] + 1; i < cut[p + 1]; ++i) {
      lower = lower.cwiseMin(boxes[order_[i]].lower);
      upper = upper.cwiseMax(boxes[order_[i]].upper);
    }
    for (int d = 0; d < 3; ++d) {
      node.boxes.centre[d][p] = static_cast<float>(0.5 * (lower[d] + upper[d]) - origin_[d]);
      node.boxes.half[d][p] = static_cast<float>(0.5 * (upper[d] - lower[d])) + rounding_;
    }
    add_slabs(triangles, cut[p], cut[p + 1], p, node);
    const bool leaf = cut[p + 1] - cut[p] <= leaf_size;
    node.first[p] = leaf ? cut[p] : build(boxes, triangles, centres, cut[p], cut[p + 1]);
    node.count[p] = leaf ? cut[p + 1] - cut[p] : 0;
  }
  nodes_[self] = node;
  return self;
}

/// Slabs about the triangles at order_[first, last).
void BoxTree::add_slabs(const std::vector<std::array<Vector3, 3>>& triangles, int first, int last, int child,
                        Node& node) const {
  if (triangles.empty())
    return;
  const auto area = [&](int place) -> Vector3 {
    const auto& [a, b, c] = triangles[order_[place]];
    return (b - a).cross(c - a);
  };
  const Vector3 one = area(first);
  Vector3 sum = Vector3::Zero();
  for (int i = first; i < last; ++i) {
    const Vector3 next = area(i);
    sum += next.dot(one) < 0 ? -next : next;
  }
  if (!(sum.norm() > 0))
    return;
  // In the plane across the normal: where the corners spread least, a principal direction of theirs.
  const Vector3 normal = sum.normalized(), u = normal.unitOrthogonal(), v = normal.cross(u);
  const double corners = 3.0 * (last - first);
  double u_mean = 0, v_mean = 0, uu = 0, vv = 0, uv = 0;
  const auto for_corners = [&](const auto& visit) {
    for (int i = first; i < last; ++i)
      for (const Vector3& corner : triangles[order_[i]])
        visit(corner - origin_);
  };
  for_corners([&](const Vector3& x) {
    u_mean += u.dot(x) / corners;
    v_mean += v.dot(x) / corners;
  });
  for_corners([&](const Vector3& x) {
    const double from_u = u.dot(x) - u_mean, from_v = v.dot(x) - v_mean;
    uu += from_u * from_u;
    vv += from_v * from_v;
    uv += from_u * from_v;
  });
  const double least = 0.5 * std::atan2(-2 * uv, vv - uu); // angle from u
  const auto set = [&](const Vector3& direction, Slabs& slabs) {
    const Eigen::Vector3f across = direction.cast<float>();
    const Vector3 exact = across.cast<double>(); // heights are those along the direction that is kept
    double lower = std::numeric_limits<double>::infinity(), upper = -lower;
    for_corners([&](const Vector3& x) {
      lower = std::min(lower, exact.dot(x));
      upper = std::max(upper, exact.dot(x));
    });
    for (int d = 0; d < 3; ++d)
      slabs.across[d][child] = across[d];
    slabs.height[child] = static_cast<float>(0.5 * (lower + upper));
    slabs.thickness[child] = static_cast<float>(0.5 * (upper - lower) + 2 * margin_) + rounding_;
  };
  set(normal, node.slabs[0]);
  const Vector3 narrowest = std::cos(least) * u + std::sin(least) * v;
  set(narrowest, node.slabs[1]);
  set(normal.cross(narrowest), node.slabs[2]);
}

bool BoxTree::any_within(const Vector3& x, double radius) const {
  if (empty())
    return false;
  const Vector3 outside = (bounds_.lower - x).cwiseMax(x - bounds_.upper).cwiseMax(0.0);
  if (!(outside.squaredNorm() <= radius * radius))
    return false;
  const Eigen::Vector3f at = (x - origin_).cast<float>();
  const float reach = static_cast<float>(radius) * (1 + 1e-6F) + 3e-7F * at.cwiseAbs().maxCoeff();
  std::array<int, stack_size> stack;
  int height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const Node& node = nodes_[stack[--height]];
    const Four squared = node.boxes.squared_distance(at);
    for (int child = 0; child < node.children; ++child) {
      if (squared[child] > reach * reach)
        continue;
      if (node.count[child] > 0)
        return true;
      stack[height++] = node.first[child];
    }
  }
  return false;
}

} // namespace spherecut::topology
