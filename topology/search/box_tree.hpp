// A tree of boxes, four children a node, over the boxes of any primitives: segments against boxes and nearest-first
// search. Over triangles every box holds three slabs as well, along their mean normal and two directions across it, one
// of them where their corners spread least: segments beside a sheet that is nearly plane, and beside narrow strips of
// it, end there, however it is turned. Single precision with an allowance for rounding, so that no query ever misses
// a primitive; the exact tests are the caller's. Queries do not allocate. Used by the incision alone.
#pragma once

#include "topology/base/types.hpp"

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace spherecut::topology {

class BoxTree {
 public:
  BoxTree() = default;
  /// One box per primitive, m, all finite.
  explicit BoxTree(const std::vector<BoundingBox>& boxes);
  /// Of triangles: queries come to those within `margin` m, too.
  BoxTree(const std::vector<std::array<Vector3, 3>>& triangles, double margin);

  /// The primitive at each place of the tree: primitives that lie close together have places close together.
  [[nodiscard]] const std::vector<int>& order() const { return order_; }
  [[nodiscard]] bool empty() const { return order_.empty(); }
  [[nodiscard]] const BoundingBox& bounds() const { return bounds_; }

  /// Calls hit(place) for every triangle that the segment a b may meet until it returns true; whether it did. A tree of
  /// boxes alone has every one of them on the way.
  template <class Hit>
  [[nodiscard]] bool any_on_segment(const Vector3& a, const Vector3& b, const Hit& hit) const;

  /// Calls hit(place) for every primitive that a segment from a point of the box centre +- half to y may meet, until it
  /// returns true; whether it did.
  template <class Hit>
  [[nodiscard]] bool any_between(const Vector3& centre, const Vector3& half, const Vector3& y, const Hit& hit) const;

  /// Visits primitives in about the order of bound(boxes), lower bounds of the cost of anything in each of four boxes,
  /// and skips the boxes whose bound is above the best cost so far.
  /// `visit(place, best)` returns the cost of a primitive if it is below `best`, else `best`. Returns the least cost.
  template <class Bound, class Visit>
  double least(double best, const Bound& bound, const Visit& visit) const;

  /// Whether the box of some primitive comes within `radius` m of x.
  [[nodiscard]] bool any_within(const Vector3& x, double radius) const;

  using Four = Eigen::Array4f;
  /// Four boxes by centre (relative to origin()) and half extent.
  struct Boxes {
    std::array<Four, 3> centre, half;
    /// Lower bounds of the squared distances of the four boxes from x, relative to origin().
    [[nodiscard]] Four squared_distance(const Eigen::Vector3f& x) const {
      const float margin = 3e-7F * x.cwiseAbs().maxCoeff();
      const Four u = ((centre[0] - x[0]).abs() - half[0] - margin).max(0.0F);
      const Four v = ((centre[1] - x[1]).abs() - half[1] - margin).max(0.0F);
      const Four w = ((centre[2] - x[2]).abs() - half[2] - margin).max(0.0F);
      return (u * u + v * v + w * w) * (1 - 1e-6F);
    }
  };
  [[nodiscard]] const Vector3& origin() const { return origin_; }

 private:
  /// Of four boxes.
  struct Slabs {
    std::array<Four, 3> across; // unit normal of each
    Four height, thickness;     // m, of the middle plane over origin_, half of its own; infinite: no slab
    [[nodiscard]] Four along(const Eigen::Vector3f& x) const {
      return across[0] * x[0] + across[1] * x[1] + across[2] * x[2];
    }
    /// How far the hull of the box c +- h and a point is from them at least.
    [[nodiscard]] Four apart(const Eigen::Vector3f& c, const Eigen::Vector3f& h, const Eigen::Vector3f& point) const {
      const Four at_point = along(point) - height, at_centre = along(c) - height;
      const Four spread = across[0].abs() * h[0] + across[1].abs() * h[1] + across[2].abs() * h[2];
      return at_point.min(at_centre - spread).max(-at_point.max(at_centre + spread)) - thickness;
    }
  };
  struct Node {
    Boxes boxes;
    std::array<Slabs, 3> slabs; // along the mean normal, and across it (about; nothing depends on right angles)
    std::array<int, 4> first;   // leaf: its first place; inner node: its index
    std::array<int, 4> count;   // primitives of a leaf, 0 for an inner node
    int children;
  };
  static constexpr int stack_size = 96; // three postponed children a level, 32 levels hold any number of primitives

  BoxTree(const std::vector<BoundingBox>& boxes, const std::vector<std::array<Vector3, 3>>& triangles, double margin);
  /// Calls hit(place) for the primitives of every box from which apart_from(node) says nothing is apart (0 or less, of
  /// four boxes) until it returns true; whether it did.
  template <class Apart, class Hit>
  bool any_met(const Apart& apart_from, const Hit& hit) const;
  int build(const std::vector<BoundingBox>& boxes, const std::vector<std::array<Vector3, 3>>& triangles,
            const std::vector<Vector3>& centres, int first, int last);
  void add_slabs(const std::vector<std::array<Vector3, 3>>& triangles, int first, int last, int child,
                 Node& node) const;
  int halve(const std::vector<Vector3>& centres, int first, int last);

  std::vector<Node> nodes_;
  std::vector<int> order_;
  BoundingBox bounds_;
  Vector3 origin_ = Vector3::Zero();
  double margin_ = 0;  // m, by which boxes of triangles are larger than these
  float rounding_ = 0; // m, by which every half extent is enlarged
};

template <class Apart, class Hit>
bool BoxTree::any_met(const Apart& apart_from, const Hit& hit) const {
  std::array<int, stack_size> stack;
  int height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const Node& node = nodes_[stack[--height]];
    const Four apart = apart_from(node);
    for (int child = 0; child < node.children; ++child) {
      if (apart[child] > 0)
        continue;
      if (node.count[child] == 0)
        stack[height++] = node.first[child];
      for (int place = node.first[child]; place < node.first[child] + node.count[child]; ++place)
        if (hit(place))
          return true;
    }
  }
  return false;
}

template <class Hit>
bool BoxTree::any_on_segment(const Vector3& a, const Vector3& b, const Hit& hit) const {
  if (empty() || (a.cwiseMin(b).array() > bounds_.upper.array()).any() ||
      (a.cwiseMax(b).array() < bounds_.lower.array()).any())
    return false;
  // Separating axes of a segment (middle m, half vector e) and the box that the slabs are: its three, and three cross
  // products.
  const Eigen::Vector3f m = (0.5 * (a + b) - origin_).cast<float>(), e = (0.5 * (b - a)).cast<float>();
  const float longest = e.cwiseAbs().maxCoeff(), size = m.cwiseAbs().maxCoeff() + longest;
  const float margin = 2 * (rounding_ + 3e-7F * size), cross_margin = 8.0F * margin * longest;
  const auto apart_from = [&](const Node& node) -> Four {
    const auto& [p, q, r] = node.slabs;
    const Four x = p.along(m) - p.height, y = q.along(m) - q.height, z = r.along(m) - r.height;
    const Four u = p.along(e), v = q.along(e), w = r.along(e), u_long = u.abs(), v_long = v.abs(), w_long = w.abs();
    Four apart = (x.abs() - u_long - p.thickness).max(y.abs() - v_long - q.thickness);
    apart = apart.max(z.abs() - w_long - r.thickness) - margin;
    apart = apart.max((y * w - z * v).abs() - q.thickness * w_long - r.thickness * v_long - cross_margin);
    apart = apart.max((z * u - x * w).abs() - r.thickness * u_long - p.thickness * w_long - cross_margin);
    apart = apart.max((x * v - y * u).abs() - p.thickness * v_long - q.thickness * u_long - cross_margin);
    return apart;
  };
  return any_met(apart_from, hit);
}

template <class Hit>
bool BoxTree::any_between(const Vector3& centre, const Vector3& half, const Vector3& y, const Hit& hit) const {
  const Vector3 lower = y.cwiseMin(centre - half), upper = y.cwiseMax(centre + half);
  if (empty() || (lower.array() > bounds_.upper.array()).any() || (upper.array() < bounds_.lower.array()).any())
    return false;
  // Separating axes of a box and the hull of the box of points (centre c, half extent h) and y: as of a segment, whose
  // projections are longer by those of the box of points; along the cross products the whole hull projects as that box.
  const Eigen::Vector3f c = (centre - origin_).cast<float>(), h = half.cast<float>(), end = (y - origin_).cast<float>();
  const Eigen::Vector3f m = (0.5 * (lower + upper) - origin_).cast<float>(),
                        reach = (0.5 * (upper - lower)).cast<float>();
  const Eigen::Vector3f e = (0.5 * (y - centre)).cast<float>(), turned = e.cwiseAbs();
  const float longest = reach.maxCoeff(), size = m.cwiseAbs().maxCoeff() + longest;
  const float margin = rounding_ + 3e-7F * size, cross_margin = 8.0F * margin * longest;
  const auto apart_from = [&](const Node& node) -> Four {
    Four apart = node.slabs[0].apart(c, h, end).max(node.slabs[1].apart(c, h, end));
    apart = apart.max(node.slabs[2].apart(c, h, end)) - 2 * margin;
    const auto& [middle, extent] = node.boxes;
    apart = apart.max((middle[0] - m[0]).abs() - extent[0] - (reach[0] + margin));
    apart = apart.max((middle[1] - m[1]).abs() - extent[1] - (reach[1] + margin));
    apart = apart.max((middle[2] - m[2]).abs() - extent[2] - (reach[2] + margin));
    const Four u = middle[0] - c[0], v = middle[1] - c[1], w = middle[2] - c[2];
    const Four a = extent[0] + h[0], b = extent[1] + h[1], d = extent[2] + h[2];
    apart = apart.max((v * e[2] - w * e[1]).abs() - b * turned[2] - d * turned[1] - cross_margin);
    apart = apart.max((w * e[0] - u * e[2]).abs() - d * turned[0] - a * turned[2] - cross_margin);
    apart = apart.max((u * e[1] - v * e[0]).abs() - a * turned[1] - b * turned[0] - cross_margin);
    return apart;
  };
  return any_met(apart_from, hit);
}

template <class Bound, class Visit>
double BoxTree::least(double best, const Bound& bound, const Visit& visit) const {
  if (empty())
    return best;
  struct Postponed {
    int first, count;
    float bound;
  };
  std::array<Postponed, stack_size> stack;
  int height = 0;
  stack[height++] = {0, 0, 0.0F};
  while (height > 0) {
    const Postponed top = stack[--height];
    if (top.bound > best)
      continue;
    for (int place = top.first; place < top.first + top.count; ++place)
      best = visit(place, best);
    if (top.count > 0)
      continue;
    const Node& node = nodes_[top.first];
    const Four bounds = bound(node.boxes);
    // Nearest last, so that it is taken first.
    const int base = height;
    for (int child = 0; child < node.children; ++child) {
      if (!(bounds[child] <= best))
        continue;
      int at = height++;
      for (; at > base && stack[at - 1].bound < bounds[child]; --at)
        stack[at] = stack[at - 1];
      stack[at] = {node.first[child], node.count[child], bounds[child]};
    }
  }
  return best;
}

} // namespace spherecut::topology
