// Integration over tetrahedra that a level set cuts, by GetFEM (which stays in its .cpp, built where it is installed).
#pragma once

#include "topology/base/types.hpp"

#include <array>
#include <vector>

namespace spherecut::experiments::ledger {

/// Tetrahedra with the values of two level sets in their corners: the cut is where the primary one is zero and the
/// secondary one negative; its front is where both are zero.
struct LevelSetCells {
  std::vector<Vector3> corners; // shared by the cells
  std::vector<std::array<int, 4>> cells;
  std::vector<double> primary, secondary; // by corner, m
};

/// Points of one cell, on either side of the cut and not on it.
struct CellRule {
  std::vector<std::array<double, 4>> place; // barycentric
  std::vector<double> weight;               // their sum is the volume, m3
};

/// Exact to degree `order` (2, 3, 5 or 6) on each side of the cut; with `singular` gathered along the front inside the
/// cells it runs through, for functions that go with the root of the distance. Throws NumericalError where GetFEM gives
/// up.
std::vector<CellRule> level_set_rules(const LevelSetCells& cells, int order, bool singular);

} // namespace spherecut::experiments::ledger
