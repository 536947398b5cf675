// Disjoint sets of numbers [Tarjan 1975: efficiency of a good but not linear set union algorithm].
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace spherecut::topology {

class DisjointSets {
 public:
  /// Each of 0 .. count - 1 is a set of its own.
  explicit DisjointSets(int count = 0) : parents_(static_cast<std::size_t>(count)) {
    std::iota(parents_.begin(), parents_.end(), 0);
  }
  /// The next number, a set of its own.
  int add() {
    parents_.push_back(size());
    return parents_.back();
  }
  /// The least number of the set that holds i.
  int find(int i) {
    while (parents_[i] != i)
      i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  /// Returns whether they were two sets.
  bool join(int i, int j) {
    const int a = find(i), b = find(j);
    parents_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }
  [[nodiscard]] int size() const { return static_cast<int>(parents_.size()); }

 private:
  std::vector<int> parents_;
};

} // namespace spherecut::topology
