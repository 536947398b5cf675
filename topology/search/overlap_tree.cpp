#include "topology/search/overlap_tree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace spherecut::topology {

namespace {

constexpr int largest_leaf = 4;

bool meet(const BoundingBox& a, const BoundingBox& b) {
  return (a.lower.array() <= b.upper.array()).all() && (b.lower.array() <= a.upper.array()).all();
}

/// Slab test with the box grown by a billionth of its distance scale, so that rounding never loses a box.
bool near_segment(const BoundingBox& box, const Vector3& a, const Vector3& b) {
  const double margin = 1e-9 * (box.extent().norm() + (b - a).norm());
  double enter = 0, leave = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double lower = box.lower[axis] - margin, upper = box.upper[axis] + margin, step = b[axis] - a[axis];
    if (step == 0) {
      if (a[axis] < lower || a[axis] > upper)
        return false;
      continue;
    }
    const double t0 = (lower - a[axis]) / step, t1 = (upper - a[axis]) / step;
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return enter <= leave;
}

} // namespace

OverlapTree::OverlapTree(const std::vector<BoundingBox>& boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!boxes.empty())
    build(boxes, 0, static_cast<int>(boxes.size()));
  boxes_.reserve(boxes.size());
  for (const int i : order_)
    boxes_.push_back(boxes[i]);
}

void OverlapTree::build(const std::vector<BoundingBox>& boxes, int begin, int end) {
  constexpr double far = std::numeric_limits<double>::infinity();
  BoundingBox box{Vector3::Constant(far), Vector3::Constant(-far)}, centres = box;
  for (int k = begin; k < end; ++k) {
    const BoundingBox& b = boxes[order_[k]];
    box.lower = box.lower.cwiseMin(b.lower);
    box.upper = box.upper.cwiseMax(b.upper);
    centres.lower = centres.lower.cwiseMin(b.centre());
    centres.upper = centres.upper.cwiseMax(b.centre());
  }
  const int node = static_cast<int>(nodes_.size());
  nodes_.push_back({box, begin, end, -1});
  if (end - begin <= largest_leaf)
    return;
  Eigen::Index axis = 0;
  centres.extent().maxCoeff(&axis);
  const int middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end, [&](int i, int j) {
    const double a = boxes[i].lower[axis] + boxes[i].upper[axis], b = boxes[j].lower[axis] + boxes[j].upper[axis];
    return a != b ? a < b : i < j;
  });
  build(boxes, begin, middle);
  nodes_[node].right = static_cast<int>(nodes_.size());
  build(boxes, middle, end);
}

void OverlapTree::meeting(const BoundingBox& box, int offset, std::vector<int>& found) const {
  std::vector<int> open;
  if (!nodes_.empty())
    open.push_back(0);
  while (!open.empty()) {
    const int index = open.back();
    const Node& node = nodes_[index];
    open.pop_back();
    if (!meet(node.box, box))
      continue;
    if (node.right < 0) {
      for (int k = node.begin; k < node.end; ++k)
        if (meet(boxes_[k], box))
          found.push_back(offset + order_[k]);
      continue;
    }
    open.push_back(node.right);
    open.push_back(index + 1);
  }
}

void OverlapTree::along(const Vector3& a, const Vector3& b, std::vector<int>& found) const {
  std::vector<int> open;
  if (!nodes_.empty())
    open.push_back(0);
  while (!open.empty()) {
    const int index = open.back();
    const Node& node = nodes_[index];
    open.pop_back();
    if (!near_segment(node.box, a, b))
      continue;
    if (node.right < 0) {
      for (int k = node.begin; k < node.end; ++k)
        if (near_segment(boxes_[k], a, b))
          found.push_back(order_[k]);
      continue;
    }
    open.push_back(node.right);
    open.push_back(index + 1);
  }
}

BoundingBox triangle_box(const Vector3& a, const Vector3& b, const Vector3& c) {
  return {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
}

} // namespace spherecut::topology
