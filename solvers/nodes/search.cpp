#include "solvers/nodes/search.hpp"

#include "topology/incision/incision.hpp"

#include <algorithm>
#include <limits>

namespace spherecut::solvers {

NodeGrid::NodeGrid(double smallest_spacing, double slope)
    : smallest_(smallest_spacing), slope_(slope), heads_(1024, -1) {}

std::array<int, 3> NodeGrid::cell_of(const Vector3& x, int level) const {
  const double scale = levels_[level].per_cell;
  return {static_cast<int>(std::floor(scale * x.x())), static_cast<int>(std::floor(scale * x.y())),
          static_cast<int>(std::floor(scale * x.z()))};
}

std::size_t NodeGrid::bucket(const std::array<int, 3>& cell, int level) const {
  std::uint64_t key = static_cast<std::uint32_t>(cell[0]) * 0x9E3779B97F4A7C15ULL;
  key ^= static_cast<std::uint32_t>(cell[1]) * 0xC2B2AE3D27D4EB4FULL;
  key ^= static_cast<std::uint32_t>(cell[2]) * 0x165667B19E3779F9ULL;
  key += static_cast<std::uint64_t>(level) * 0x27D4EB2F165667C5ULL;
  return (key ^ (key >> 32)) & (heads_.size() - 1);
}

void NodeGrid::link(int node) {
  Entry& entry = entries_[node];
  int& head = heads_[bucket(entry.cell, entry.level)];
  entry.next = head;
  head = node;
}

void NodeGrid::rehash(std::size_t buckets) {
  heads_.assign(buckets, -1);
  for (int j = 0; j < size(); ++j)
    link(j);
}

void NodeGrid::add(const Vector3& position, double spacing) {
  const int level = std::max(0, static_cast<int>(std::floor(std::log2(spacing / smallest_))));
  for (int next = static_cast<int>(levels_.size()); next <= level; ++next)
    levels_.push_back({0, 1 / std::ldexp(smallest_, next + 1), 0});
  levels_[level].largest = std::max(levels_[level].largest, spacing);
  ++levels_[level].nodes;
  entries_.push_back({position, spacing, cell_of(position, level), level, -1});
  if (2 * entries_.size() > heads_.size())
    rehash(2 * heads_.size());
  else
    link(size() - 1);
}

bool NodeGrid::crowded(const Vector3& x, double h, double factor) const {
  // The level of x itself first: that is where a crowding node most likely is.
  const int levels = static_cast<int>(levels_.size());
  const int own = std::clamp(static_cast<int>(std::log2(std::max(1.0, h / smallest_))), 0, std::max(0, levels - 1));
  for (int k = 0; k < levels; ++k) {
    const int level = k == 0 ? own : (k <= own ? k - 1 : k);
    if (levels_[level].nodes == 0)
      continue;
    // A node of this level within reach is at most `reach` away, so its spacing is at least h - slope reach; and where
    // it is coarser than x, h_j <= h + slope |x - x_j| bounds its distance.
    const double largest = levels_[level].largest;
    const double by_slope = slope_ * factor < 2 ? factor * h / (1 - 0.5 * factor * slope_) : 1e300;
    const double reach = std::min(0.5 * factor * (h + largest), by_slope * (1 + 1e-12));
    if (largest < h - slope_ * reach)
      continue;
    if (visit_level(level, x, reach, [&](int j) {
          const double limit = 0.5 * factor * (h + entries_[j].spacing);
          return (entries_[j].position - x).squaredNorm() < limit * limit &&
                 (walls_ == nullptr || !walls_->blocks(x, entries_[j].position));
        }))
      return true;
  }
  return false;
}

double NodeGrid::nearest_distance(const Vector3& x, double h, int except, double beyond) const {
  double best = std::numeric_limits<double>::infinity();
  for (double radius = 1.25 * h;; radius *= 2) {
    int visited = 0;
    for_each_within(x, h, radius, [&](int j, double distance) {
      ++visited;
      if (j != except && distance > beyond)
        best = std::min(best, distance);
    });
    if (best <= radius || visited == size())
      return best;
  }
}

double NodeGrid::nearest_in_spacings(const Vector3& x, double h, int except, double beyond) const {
  const double nearest = nearest_distance(x, h, except, beyond);
  double best = std::numeric_limits<double>::infinity();
  if (!std::isfinite(nearest))
    return best;
  for_each_within(x, h, 2 * nearest, [&](int j, double distance) {
    if (j != except && distance > beyond)
      best = std::min(best, 2 * distance / (h + spacing(j)));
  });
  return best;
}

} // namespace spherecut::solvers
