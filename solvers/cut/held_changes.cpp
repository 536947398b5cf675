#include "solvers/cut/held_changes.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace spherecut::solvers {

bool equal_to_rounding(const DisplacementMean& a, const DisplacementMean& b) {
  return a.nodes == b.nodes && std::equal(a.weights.begin(), a.weights.end(), b.weights.begin(),
                                          [](double v, double w) { return std::abs(v - w) <= 1e-14; });
}

Shares::Shares(const Problem& problem, const std::vector<char>& removed,
               const std::optional<SurfacePatches::Part>& part, SurfacePatches::Of of)
    : nodes(present_nodes(problem.nodes, removed)), patches(*problem.domain, nodes, problem.incision, part, of) {
  int place = 0;
  for (const char gone : removed)
    compact.push_back(gone != 0 ? -1 : place++);
}

std::vector<DisplacementMean> held_means(const Problem& problem, const Spheres& spheres, const Shares& shares) {
  if (problem.prescribed_region) {
    std::vector<Prescribed> entries = problem.prescribed;
    for (Prescribed& entry : entries)
      entry.node = shares.compact[entry.node];
    return shares.patches.means(entries, spheres, problem.prescribed_region);
  }
  std::vector<DisplacementMean> means;
  means.reserve(problem.prescribed.size());
  for (const Prescribed& entry : problem.prescribed)
    means.push_back(value_at(spheres, problem.nodes.positions[entry.node]));
  return means;
}

std::vector<HeldChange> held_changes(const std::vector<Prescribed>& before, const std::vector<DisplacementMean>& old,
                                     const std::vector<Prescribed>& now, const std::vector<DisplacementMean>& held) {
  const auto key = [](const Prescribed& one) { // a node has an entry for every set of axes that are held together
    return 8L * one.node + (one.components[0] ? 1 : 0) + (one.components[1] ? 2 : 0) + (one.components[2] ? 4 : 0);
  };
  std::unordered_map<long, int> entry;
  for (int k = 0; k < std::ssize(before); ++k)
    entry.emplace(key(before[k]), k);
  std::vector<HeldChange> changes;
  for (int k = 0; k < std::ssize(now); ++k) {
    const auto known = entry.find(key(now[k]));
    if (known == entry.end()) {
      changes.push_back({-1, k});
      continue;
    }
    const int b = known->second;
    entry.erase(known);
    if (!equal_to_rounding(held[k], old[b]))
      changes.push_back({b, k});
  }
  for (int k = 0; k < std::ssize(before); ++k)
    if (entry.contains(key(before[k])))
      changes.push_back({k, -1});
  return changes;
}

} // namespace spherecut::solvers
