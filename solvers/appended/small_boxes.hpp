// Quadrature of the weak form by small boxes. A background cell is divided into 2 x 2 x 2 boxes. A box keeps the shape
// functions at the centroid of its part inside the body, and within the box they count as linear about that place. So
// a box can be split later without evaluating a shape function again.
#pragma once

#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/functions.hpp"

#include <mutex>
#include <span>

namespace spherecut::solvers {

struct SmallBox {
  Vector3 centre, half; // m
  Vector3 middle;       // m, centroid of the part inside the body
  double volume = 0;    // m3, of that part
  bool whole = true;    // the box lies inside the body
};

/// Shape functions of one background cell at the middles of its boxes.
struct BoxShapes {
  static constexpr int lanes = 8;                           // boxes of a cell at most
  Vector3 centre = Vector3::Zero(), half = Vector3::Zero(); // m, of the cell
  int first_box = 0, boxes = 0;
  std::vector<int> nodes;        // that support some box, ascending
  std::vector<double> value;     // [node][lane]; zero in the lanes that are left
  std::vector<double> gradients; // [lane][axis][node], 1/m
  [[nodiscard]] double value_at(std::size_t k, int lane) const { return value[k * lanes + lane]; }
  [[nodiscard]] Vector3 gradient_at(std::size_t k, int lane) const {
    const double* at = gradients.data() + 3 * nodes.size() * lane + k;
    return {at[0], at[nodes.size()], at[2 * nodes.size()]};
  }
};

class SmallBoxes {
 public:
  /// The spheres outlive this. Throws NumericalError where the middle of a box has no sound support.
  SmallBoxes(const topology::Domain& domain, const NodeCloud& nodes, const Spheres& spheres, double cell_size);

  [[nodiscard]] const std::vector<SmallBox>& boxes() const { return boxes_; }
  [[nodiscard]] const std::vector<BoxShapes>& cells() const { return cells_; }
  [[nodiscard]] int size() const { return static_cast<int>(boxes_.size()); }
  [[nodiscard]] int cell_of(int box) const { return cell_of_[box]; }
  [[nodiscard]] int lane_of(int box) const { return box - cells_[cell_of_[box]].first_box; }
  /// Replaces the gradient of the k-th node of a cell at a box.
  void set_gradient(int cell, std::ptrdiff_t k, int lane, const Vector3& gradient);
  /// Cells that a node supports, ascending.
  [[nodiscard]] std::span<const int> cells_of_node(int node) const {
    return std::span(node_cells_).subspan(node_cell_start_[node], node_cell_start_[node + 1] - node_cell_start_[node]);
  }
  /// Boxes that share a piece of a face with this one, ascending.
  [[nodiscard]] std::span<const int> neighbours(int box) const {
    return std::span(neighbours_).subspan(neighbour_start_[box], neighbour_start_[box + 1] - neighbour_start_[box]);
  }
  /// Shape functions evaluated at x, but for those of spheres that its box does not feel: no equation knows of their
  /// unknowns there. Throws NumericalError where no sound support covers x.
  void evaluate(int box, const Vector3& x, ShapeFunctions& shape) const;
  /// The box that holds x, or the nearest where none does.
  [[nodiscard]] int locate(const Vector3& x) const;
  /// Boxes that may meet the region, ascending.
  void within(const BoundingBox& region, std::vector<int>& found) const;
  /// Boxes that the sphere of a node may reach, ascending. Found as they are asked for, and kept; thread safe.
  [[nodiscard]] const std::vector<int>& in_reach(int node) const;
  /// Cells in an order in which neighbours follow one another.
  [[nodiscard]] const std::vector<int>& cells_by_place() const { return order_; }

 private:
  void add_cell(const topology::Domain& domain, const BackgroundBox& cell);
  void evaluate_all();
  void sort_into_bins(const BoundingBox& bounds);
  void find_neighbours();
  [[nodiscard]] std::array<int, 3> bin_of(const Vector3& x) const;

  const Spheres& spheres_;
  std::vector<SmallBox> boxes_;
  std::vector<BoxShapes> cells_;
  std::vector<int> cell_of_, order_;
  std::vector<int> neighbour_start_, neighbours_;
  std::vector<int> node_cell_start_, node_cells_;
  Vector3 bin_origin_ = Vector3::Zero(), bin_size_ = Vector3::Ones(); // m
  std::array<int, 3> bins_{1, 1, 1};
  std::vector<int> bin_start_, bin_boxes_;
  mutable std::mutex reach_mutex_;
  mutable std::vector<std::vector<int>> reach_; // by node; empty: not known
};

/// Takes out the functions for which is_out(k), and corrects the others so that they reproduce linear functions as
/// before.
template <class IsOut>
void take_out(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape, IsOut&& is_out);
/// h + h M p with p = (1, (x_J - x) / R), so that constants and linear functions are reproduced.
void reproduce_linear(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape);

/// Part of a small box inside the body: its volume over that of the box, and how far its centroid lies from the box's
/// centre, m. Exact for a face of the body along a face of the box, of second order otherwise.
std::pair<double, Vector3> part_inside(const topology::Domain& domain, const Vector3& centre, const Vector3& half);

template <class IsOut>
void take_out(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape, IsOut&& is_out) {
  bool any = false;
  for (int k = 0; k < shape.size(); ++k)
    if (is_out(k)) {
      shape.value[k] = shape.dx[k] = shape.dy[k] = shape.dz[k] = 0;
      any = true;
    }
  if (any)
    reproduce_linear(spheres, x, shape);
}

} // namespace spherecut::solvers
