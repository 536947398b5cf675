// Nodes after an increment of a cut.
#pragma once

#include "solvers/nodes/nodes.hpp"

namespace spherecut::experiments {

/// The nodes that stay, in their order, and after them those that are added.
inline solvers::NodeCloud exchanged(const solvers::NodeCloud& nodes, const solvers::SprinkleIncrement& change) {
  solvers::NodeCloud after;
  auto removed = change.removed.begin();
  for (int i = 0; i < nodes.size(); ++i)
    if (removed != change.removed.end() && *removed == i)
      ++removed;
    else
      after.add(nodes, i);
  for (int j = 0; j < change.added.size(); ++j)
    after.add(change.added, j);
  return after;
}

} // namespace spherecut::experiments
