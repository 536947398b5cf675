// Axisymmetric linear elasticity with biquadratic finite elements: a reference that shares nothing with the methods
// under test.
#pragma once

#include "solvers/elasticity/material.hpp"
#include "topology/base/types.hpp"

#include <functional>
#include <vector>

namespace spherecut::experiments {

using Vector2 = Eigen::Vector2d;

/// A structured grid of 9-node elements in the half-plane r >= 0. Element (i, j) spans nodes 2i .. 2i+2 in one
/// direction and 2j .. 2j+2 in the other; edges are curved through their middle nodes.
struct AxisymmetricGrid {
  int rows = 0, columns = 0;  // nodes in the two directions, odd and >= 3
  std::vector<Vector2> nodes; // (r, z) in m, node(i, j) = nodes[i * columns + j]
  [[nodiscard]] int node(int row, int column) const { return row * columns + column; }
};

/// Nodes at map(s, t) for the corners of the elements and halfway between them in s and t: map(rows[i], columns[j]).
AxisymmetricGrid make_grid(const std::vector<double>& rows, const std::vector<double>& columns,
                           const std::function<Vector2(double, double)>& map);

/// n + 1 values from `dense` to `coarse` whose steps shrink towards `dense` like s^exponent, s = k / n.
std::vector<double> graded_interval(double dense, double coarse, int n, double exponent);

/// Displacement of one component (0: r, 1: z) of a node, m.
struct AxisymmetricSupport {
  int node = 0;
  int component = 0;
  double value = 0;
};

struct AxisymmetricSolution {
  std::vector<Vector2> displacement; // m, one per node
  std::vector<Vector2> reaction;     // N around the whole axis: force of the supports on the body, one per node
};

/// Solves with the given supports, no other loads, and u_r = 0 on the axis. Every boundary left alone is free. Meant
/// for nu <= 0.45: nearer 1/2 the displacement elements lose accuracy. Throws InputError for an inconsistent grid or a
/// support outside it, NumericalError naming an inverted element or for a singular system (body not held).
AxisymmetricSolution solve_axisymmetric(const AxisymmetricGrid& grid, const solvers::Material& material,
                                        const std::vector<AxisymmetricSupport>& supports);
/// The same of several materials: `material_of` tells that of the element with its middle node at (r, z).
AxisymmetricSolution solve_axisymmetric(const AxisymmetricGrid& grid,
                                        const std::function<solvers::Material(const Vector2& middle)>& material_of,
                                        const std::vector<AxisymmetricSupport>& supports);

} // namespace spherecut::experiments
