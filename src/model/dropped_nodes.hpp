// Nodes of severed pieces that have left the computation (cut.unheld = "drop"): nothing meets them any more.
#pragma once

#include "src/scenario/scenario.hpp"

#include <algorithm>
#include <vector>

namespace spherecut::app {

/// Per node of the body: 1 when its piece has left the computation; empty when none has.
inline std::vector<char> dropped_nodes(const Scenario& scenario, const solvers::Discretisation& body) {
  std::vector<char> dropped;
  if (scenario.cut.unheld == solvers::UnheldPieces::drop)
    for (const solvers::Piece& piece : body.report().pieces)
      if (!piece.held) {
        dropped.resize(body.problem().nodes.positions.size(), 0);
        for (const int node : piece.nodes)
          dropped[node] = 1;
      }
  return dropped;
}

/// Those of the nodes whose pieces are there.
inline std::vector<int> without_dropped(std::vector<int> nodes, const Scenario& scenario,
                                        const solvers::Discretisation& body) {
  const std::vector<char> dropped = dropped_nodes(scenario, body);
  if (!dropped.empty())
    std::erase_if(nodes, [&](int node) { return dropped[node] != 0; });
  return nodes;
}

} // namespace spherecut::app
