// What the mesher is asked for: the organ, the plane of the cut, its front, and sizes graded as our nodes are.
#pragma once

#include "experiments/remeshing_ledger/scenario.hpp"
#include "experiments/remeshing_ledger/volume_mesher.hpp"

namespace spherecut::experiments::ledger {

/// Edges of the organ, border of the cut's plane, and the front.
std::vector<std::vector<Vector3>> mesh_features(const Scenario& scenario, int increment);

/// Those of them that bound the cut: pieces of the border inside its outline, and the front's.
struct CutCurves {
  std::vector<std::vector<Vector3>> border, front;
};
CutCurves cut_curves(const Scenario& scenario, int increment);

MeshRequest mesh_request(const Scenario& scenario, int increment, const Grading& grading);

} // namespace spherecut::experiments::ledger
