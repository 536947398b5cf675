// Incremental neighbour search among nodes whose spacing varies from place to place.
#pragma once

#include "topology/base/types.hpp"

#include <cmath>

namespace spherecut::topology {
class Incision;
}

namespace spherecut::solvers {

/// Hash grids, one per octave of the node spacing h, so that a query visits a few cells whatever the grading. Nodes can
/// be added at any time. The spacing must be Lipschitz: |h(x) - h(y)| <= slope |x - y| for all nodes and query points.
class NodeGrid {
 public:
  /// smallest_spacing (m) is the lower bound of every h that will be added; slope in m per m, below 2.
  NodeGrid(double smallest_spacing, double slope);

  /// The nodes are numbered 0, 1, ... in the order they are added.
  void add(const Vector3& position, double spacing);
  [[nodiscard]] int size() const { return static_cast<int>(entries_.size()); }

  /// Whether some node j has |x - x_j| < factor (h + h_j) / 2.
  [[nodiscard]] bool crowded(const Vector3& x, double h, double factor) const;

  /// With walls (they have to outlive the grid) nodes that they hide from x crowd it no longer.
  void set_walls(const topology::Incision* walls) { walls_ = walls; }

  /// Distance from x to the nearest node other than `except` that is farther than `beyond` m; infinity when there is
  /// none. h is the spacing at x.
  [[nodiscard]] double nearest_distance(const Vector3& x, double h, int except = -1, double beyond = -1) const;

  /// Smallest 2 |x - x_j| / (h + h_j) over those nodes j that are not farther than twice the nearest.
  [[nodiscard]] double nearest_in_spacings(const Vector3& x, double h, int except = -1, double beyond = -1) const;
  [[nodiscard]] double spacing(int node) const { return entries_[node].spacing; }

  /// Calls visit(j, |x - x_j|) for every node within radius of x, in no particular but a reproducible order. A node may
  /// be visited only once. h is the spacing at x.
  template <class Visitor>
  void for_each_within(const Vector3& x, double h, double radius, Visitor&& visit) const;

 private:
  struct Entry {
    Vector3 position;
    double spacing;
    std::array<int, 3> cell;
    int level;
    int next; // in the chain of its bucket
  };
  struct Level {
    double largest = 0;  // m, largest spacing of its nodes
    double per_cell = 0; // 1/m, inverse of its cell size, twice the smallest spacing of its octave
    int nodes = 0;
  };

  [[nodiscard]] std::array<int, 3> cell_of(const Vector3& x, int level) const;
  [[nodiscard]] std::size_t bucket(const std::array<int, 3>& cell, int level) const;
  void link(int node);
  void rehash(std::size_t buckets);
  /// Calls visit(entry index) for all nodes of a level in the cells that a ball touches; stops when it returns true.
  template <class Visitor>
  bool visit_level(int level, const Vector3& x, double radius, Visitor&& visit) const;

  double smallest_, slope_;
  const topology::Incision* walls_ = nullptr;
  std::vector<Entry> entries_;
  std::vector<Level> levels_;
  std::vector<int> heads_; // of the bucket chains, power of two in number
};

template <class Visitor>
bool NodeGrid::visit_level(int level, const Vector3& x, double radius, Visitor&& visit) const {
  const std::array<int, 3> lower = cell_of(x - Vector3::Constant(radius), level);
  const std::array<int, 3> upper = cell_of(x + Vector3::Constant(radius), level);
  double cells = 1;
  for (int d = 0; d < 3; ++d)
    cells *= upper[d] - lower[d] + 1;
  if (cells > 2.0 * size()) {
    for (int j = 0; j < size(); ++j)
      if (entries_[j].level == level && visit(j))
        return true;
    return false;
  }
  std::array<int, 3> cell{};
  for (cell[2] = lower[2]; cell[2] <= upper[2]; ++cell[2])
    for (cell[1] = lower[1]; cell[1] <= upper[1]; ++cell[1])
      for (cell[0] = lower[0]; cell[0] <= upper[0]; ++cell[0])
        for (int j = heads_[bucket(cell, level)]; j >= 0; j = entries_[j].next) {
          const Entry& entry = entries_[j];
          if (entry.cell[0] == cell[0] && entry.cell[1] == cell[1] && entry.cell[2] == cell[2] &&
              entry.level == level && visit(j))
            return true;
        }
  return false;
}

template <class Visitor>
void NodeGrid::for_each_within(const Vector3& x, double h, double radius, Visitor&& visit) const {
  for (int level = 0; level < std::ssize(levels_); ++level) {
    if (levels_[level].nodes == 0 || levels_[level].largest < h - slope_ * radius)
      continue;
    visit_level(level, x, radius, [&](int j) {
      const double distance = (entries_[j].position - x).norm();
      if (distance <= radius)
        visit(j, distance);
      return false;
    });
  }
}

} // namespace spherecut::solvers
