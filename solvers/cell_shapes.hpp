// Shape function gradients of one background cell of the weak form, the raw material of its stiffness.
#pragma once

#include "solvers/background_cells.hpp"
#include "solvers/shape_functions.hpp"

#include <cstdint>
#include <span>

namespace spherecut::solvers {

/// Gradients over the union of the supports of the cell's points.
struct CellShapes {
  std::vector<int> nodes;             // ascending
  std::vector<std::uint32_t> reached; // bit q: the node supports point q; nodes without a common bit do not couple
  int points = 0;
  int stride = 0;                // columns, a multiple of 8
  std::vector<double> gradients; // [point][axis][stride], 1/m times sqrt(weight)
};

/// Evaluates cells one after another; keeps its memory between them.
class CellEvaluator {
 public:
  explicit CellEvaluator(const Spheres& spheres) : spheres_(spheres), place_(spheres.size(), -1) {}

  /// Throws NumericalError when a point has no sound support.
  void evaluate(std::span<const QuadraturePoint> points, CellShapes& cell);

 private:
  const Spheres& spheres_;
  std::vector<int> place_; // of a node in the cell, -1 outside
  std::array<ShapeFunctions, most_cell_points> at_point_;
};

/// Cells in an order in which neighbours follow one another (Morton order of their boxes).
std::vector<int> cells_by_place(const BackgroundCells& cells);

} // namespace spherecut::solvers
