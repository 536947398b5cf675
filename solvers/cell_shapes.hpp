// Shape function gradients of one background cell of the weak form, the raw material of its stiffness.
#pragma once

#include "solvers/background_cells.hpp"
#include "solvers/shape_functions.hpp"
#include "solvers/stiffness_kernel.hpp"

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

  /// Throws NumericalError when a point has no sound support or more nodes reach the cell than the kernel handles.
  void evaluate(std::span<const QuadraturePoint> points, CellShapes& cell);

 private:
  const Spheres& spheres_;
  std::vector<int> place_; // of a node in the cell, -1 outside
  std::array<ShapeFunctions, most_cell_points> at_point_;
};

/// Neighbouring cells taken together: they share most of their nodes, so that each pair of nodes is added to a matrix
/// once for all their points.
class CellCluster {
 public:
  /// `node_count`: ids of nodes are smaller.
  explicit CellCluster(int node_count) : place_(node_count, -1) {}

  /// Whether there is room for one more cell; there always is in an empty cluster.
  [[nodiscard]] bool has_room_for(const CellShapes& cell) const;
  /// `sign` multiplies the cell's stiffness. The cell must stay alive until clear(). `id`: what cells() tells.
  void add(const CellShapes& cell, double sign = 1, int id = -1);
  void clear();
  [[nodiscard]] bool empty() const { return parts_.empty(); }
  [[nodiscard]] const std::vector<int>& cells() const { return cells_; }

  /// Nodes of all cells, as they came until gather() puts them into ascending order of rank[node].
  [[nodiscard]] const std::vector<int>& nodes() const { return nodes_; }
  /// Bit q of an entry: the node supports point q; by place in nodes().
  [[nodiscard]] const std::vector<std::uint64_t>& reached() const { return reached_; }
  /// Sorts the nodes and brings the gradients together.
  void gather(const std::vector<int>& rank);
  /// Blocks of the rows from `own` on of one column of the cluster's stiffness, by place in nodes(). Needs gather().
  void column(int own, double lambda, double mu, StiffnessColumn& out) const {
    stiffness_column(gradients_.data(), signs_.data(), points_, stride_, own, static_cast<int>(nodes_.size()), own,
                     lambda, mu, out);
  }

 private:
  struct Part {
    const CellShapes* cell;
    double sign;
  };
  std::vector<Part> parts_;
  std::vector<int> cells_, nodes_;
  std::vector<std::uint64_t> reached_;
  std::vector<int> place_; // of a node in nodes_, -1 outside
  int points_ = 0, stride_ = 0;
  std::vector<double> signs_, gradients_; // [point][axis][stride]
  std::vector<std::pair<int, int>> order_;
};

/// Cells in an order in which neighbours follow one another (Morton order of their boxes).
std::vector<int> cells_by_place(const BackgroundCells& cells);

} // namespace spherecut::solvers
