// Static tree over boxes in double precision: which of them meet a box, or lie along a segment.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::topology {

/// Boxes in a median-split binary tree with implicit layout; immutable once built.
class OverlapTree {
 public:
  OverlapTree() = default;
  explicit OverlapTree(const std::vector<BoundingBox>& boxes);

  /// Appends the indices of all boxes that meet `box` (touching counts, nothing is missed), plus `offset`.
  void meeting(const BoundingBox& box, int offset, std::vector<int>& found) const;

  /// Appends the indices of all boxes that the segment from a to b meets, and perhaps of some it just misses.
  void along(const Vector3& a, const Vector3& b, std::vector<int>& found) const;

  [[nodiscard]] int size() const { return static_cast<int>(order_.size()); }

 private:
  struct Node {
    BoundingBox box;
    int begin, end; // leaves: range of order_
    int right;      // second child; the first follows its parent; -1 at a leaf
  };
  void build(const std::vector<BoundingBox>& boxes, int begin, int end);
  std::vector<Node> nodes_;
  std::vector<int> order_;
  std::vector<BoundingBox> boxes_; // in tree order
};

/// Smallest box around three points.
BoundingBox triangle_box(const Vector3& a, const Vector3& b, const Vector3& c);

} // namespace spherecut::topology
