#include "solvers/held_changes.hpp"

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
    std::vector<int> nodes;
    nodes.reserve(problem.prescribed.size());
    for (const Prescribed& entry : problem.prescribed)
      nodes.push_back(shares.compact[entry.node]);
    return shares.patches.means(nodes, spheres, problem.prescribed_region);
  }
  std::vector<DisplacementMean> means;
  means.reserve(problem.prescribed.size());
  for (const Prescribed& entry : problem.prescribed)
    means.push_back(value_at(spheres, problem.nodes.positions[entry.node]));
  return means;
}

std::vector<HeldChange> held_changes(const std::vector<Prescribed>& before, const std::vector<DisplacementMean>& old,
                                     const std::vector<Prescribed>& now, const std::vector<DisplacementMean>& held) {
  std::unordered_map<int, int> entry;
  for (int k = 0; k < std::ssize(before); ++k)
    entry.emplace(before[k].node, k);
  std::vector<HeldChange> changes;
  for (int k = 0; k < std::ssize(now); ++k) {
    const auto known = entry.find(now[k].node);
    if (known == entry.end()) {
      changes.push_back({-1, k});
      continue;
    }
    const int b = known->second;
    entry.erase(known);
    if (!equal_to_rounding(held[k], old[b]) || now[k].components != before[b].components)
      changes.push_back({b, k});
  }
  for (int k = 0; k < std::ssize(before); ++k)
    if (entry.contains(before[k].node))
      changes.push_back({k, -1});
  return changes;
}

} // namespace spherecut::solvers
