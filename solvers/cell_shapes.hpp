// Shape function gradients of one background cell of the weak form, the raw material of its stiffness.
#pragma once

#include "solvers/background_cells.hpp"
#include "solvers/shape_functions.hpp"

#include <span>

namespace spherecut::solvers {

/// Gradients over the union of the supports of the cell's points.
struct CellShapes {
  std::vector<int> nodes;             // ascending: ids of nodes, or after renumber() their elimination ranks
  std::vector<std::uint32_t> reached; // bit q: the node supports point q; nodes without a common bit do not couple
  int points = 0;
  int stride = 0;                // columns, a multiple of 8
  std::vector<double> gradients; // [point][axis][stride], 1/m times sqrt(weight)
};

/// Evaluates cells one after another; keeps its memory between them.
class CellEvaluator {
 public:
  explicit CellEvaluator(const Spheres& spheres) : spheres_(spheres), place_(spheres.size(), -1) {}

  /// Throws NumericalError when a point has no sound support or more nodes reach the cell than the kernel handles.
  void evaluate(std::span<const QuadraturePoint> points, CellShapes& cell);

  /// Numbers the columns by rank[node] instead, in ascending order.
  void renumber(const std::vector<int>& rank, CellShapes& cell);

 private:
  const Spheres& spheres_;
  std::vector<int> place_; // of a node in the cell, -1 outside
  std::array<ShapeFunctions, most_cell_points> at_point_;
  std::vector<std::pair<int, int>> order_;
  std::vector<double> gradients_;
  std::vector<std::uint32_t> reached_;
};

} // namespace spherecut::solvers
