#include "solvers/contact/bank_pairs.hpp"

#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace spherecut::solvers {

namespace {

constexpr double facing = -0.3; // cosine between the normals of banks
constexpr double aside = 0.75;  // spacings off the normal at which a node still faces another

struct Facing {
  int from, to;
  double gap, opening; // m, along the normal of `from`: at rest, now
};

/// Which nodes pairs have joined.
class Rings {
 public:
  explicit Rings(int nodes) : parent_(static_cast<std::size_t>(nodes)) { std::iota(parent_.begin(), parent_.end(), 0); }
  /// False, and nothing is joined, where the two are already.
  bool join(int i, int j) {
    const int a = root_of(i), b = root_of(j);
    if (a == b)
      return false;
    parent_[a] = b;
    return true;
  }

 private:
  int root_of(int i) {
    while (parent_[i] != i)
      i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  std::vector<int> parent_;
};

} // namespace

BankPairs bank_pairs(const NodeCloud& nodes, const VectorX& displacement, double near) {
  std::vector<int> skin;
  std::vector<Vector3> moved;
  double farthest = 0, widest = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3 u = displacement.segment<3>(3 * static_cast<Eigen::Index>(i));
    if (nodes.kinds[i] != NodeKind::surface && nodes.kinds[i] != NodeKind::edge)
      continue;
    skin.push_back(i);
    moved.push_back(nodes.positions[i] + u);
    farthest = std::max(farthest, u.norm());
    widest = std::max(widest, nodes.spacings[i]);
  }
  BankPairs found;
  if (skin.empty() || farthest == 0)
    return found;
  const topology::PointTree tree(moved);
  std::vector<Facing> all;
  std::vector<topology::PointTree::Found> about;
  for (std::size_t k = 0; k < skin.size(); ++k) {
    const int i = skin[k];
    const Vector3& normal = nodes.normals[i];
    about.clear();
    tree.within(moved[k], std::hypot(aside * widest, std::max(2 * farthest, near * nodes.spacings[i])), about);
    std::sort(about.begin(), about.end());
    Facing best{i, -1, std::numeric_limits<double>::infinity(), 0};
    for (const topology::PointTree::Found& other : about) {
      const int j = skin[other.index];
      if (normal.dot(nodes.normals[j]) > facing)
        continue;
      const Vector3 apart = nodes.positions[j] - nodes.positions[i], now = moved[other.index] - moved[k];
      const double gap = normal.dot(apart), opening = normal.dot(now);
      if (!(gap > 0) || !(nodes.normals[j].dot(apart) < 0) || opening > near * nodes.spacings[i] ||
          (now - opening * normal).norm() > aside * nodes.spacings[j] || gap >= best.gap)
        continue;
      best = {i, j, gap, opening};
    }
    if (best.to >= 0)
      all.push_back(best);
  }
  std::stable_sort(all.begin(), all.end(), [](const Facing& a, const Facing& b) { return a.opening < b.opening; });
  Rings rings(nodes.size());
  for (const Facing& one : all)
    if (rings.join(one.from, one.to)) {
      found.pairs.push_back({one.to, one.from, nodes.normals[one.from], one.gap, true});
      found.openings.push_back(one.opening);
    }
  return found;
}

std::vector<LipPair> joined_without_rings(std::vector<LipPair> pairs, const std::vector<LipPair>& more, int nodes) {
  Rings rings(nodes);
  for (const LipPair& pair : pairs)
    rings.join(pair.plus, pair.minus);
  for (const LipPair& pair : more)
    if (rings.join(pair.plus, pair.minus))
      pairs.push_back(pair);
  return pairs;
}

} // namespace spherecut::solvers
