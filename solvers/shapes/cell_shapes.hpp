// Shape function gradients of one background cell of the weak form, the raw material of its stiffness.
#pragma once

#include "solvers/shapes/cut_sight.hpp"

#include <cstdint>
#include <span>

namespace spherecut::solvers {

/// Gradients over the union of the supports of the cell's points.
struct CellShapes {
  std::vector<int> nodes;             // ascending
  std::vector<std::uint32_t> reached; // bit q: the node supports point q; nodes without a common bit do not couple
  int points = 0;
  int stride = 0;                // room for the points, a multiple of 8
  std::vector<double> gradients; // [node][axis][stride], 1/m times sqrt(weight); zero in the room that is left
  /// Of the k-th node at point q.
  [[nodiscard]] Vector3 gradient(std::size_t k, int q) const {
    const double* at = gradients.data() + 3 * k * static_cast<std::size_t>(stride) + q;
    return {at[0], at[stride], at[2 * static_cast<std::ptrdiff_t>(stride)]};
  }
};

/// Evaluates cells one after another; keeps its memory between them.
class CellEvaluator {
 public:
  explicit CellEvaluator(const Spheres& spheres)
      : spheres_(spheres), place_(spheres.size(), -1), marked_(spheres.size() / 64 + 1, 0) {}

  /// Throws NumericalError when a point has no sound support.
  void evaluate(std::span<const QuadraturePoint> points, CellShapes& out);

 private:
  /// All points at once but those whose shape functions a cut alters; false where a support is not sound.
  bool evaluate_together(std::span<const QuadraturePoint> points, CellShapes& cell);
  /// Adds the points that a cut alters; false where a support is not sound or has grown beyond the nodes of the cell.
  bool add_altered(std::span<const QuadraturePoint> points, CellShapes& cell);
  void evaluate_each(std::span<const QuadraturePoint> points, CellShapes& cell);
  void find_candidates(std::span<const QuadraturePoint> points, CellShapes& cell);
  bool keep_reached(std::span<const QuadraturePoint> points, CellShapes& cell);
  bool evaluate_altered(const Vector3& x, int q, CellShapes& cell);
  static void drop_unreached(CellShapes& cell);

  const Spheres& spheres_;
  std::vector<int> place_;            // of a node in the cell, -1 outside
  std::vector<std::uint64_t> marked_; // a bit of every node, all 0 between calls
  std::vector<shape_kernel::Sphere> candidates_;
  std::array<shape_kernel::Points, (most_cell_points - 1) / shape_kernel::points_together + 1> batch_;
  std::vector<std::uint8_t> inside_;
  CellView view_;
  // The support of one point, and which of its nodes are hidden; room for a register beyond the last.
  std::vector<int> ids_;
  std::vector<double> coordinates_;
  std::vector<char> hidden_;
  std::array<ShapeFunctions, most_cell_points> at_point_;
  CellShapes work_;
};

/// Cells in an order in which neighbours follow one another (Morton order of their boxes).
std::vector<int> cells_by_place(const BackgroundCells& cells);

} // namespace spherecut::solvers
