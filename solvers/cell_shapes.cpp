#include "solvers/cell_shapes.hpp"

#include "solvers/stiffness_kernel.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

static_assert(most_cell_points <= stiffness_kernel_points);

void CellEvaluator::evaluate(std::span<const QuadraturePoint> points, CellShapes& cell) {
  cell.points = static_cast<int>(points.size());
  cell.nodes.clear();
  for (int q = 0; q < cell.points; ++q) {
    const Vector3& x = points[q].position;
    if (!solvers::evaluate(spheres_, x, at_point_[q]))
      throw NumericalError(fmt::format("the quadrature point ({:.6g}, {:.6g}, {:.6g}) m has {} supporting nodes: the "
                                       "nodes leave a hole there",
                                       x.x(), x.y(), x.z(), at_point_[q].size()));
    for (int node : at_point_[q].nodes)
      if (place_[node] < 0) {
        place_[node] = 0;
        cell.nodes.push_back(node);
      }
  }
  std::sort(cell.nodes.begin(), cell.nodes.end());
  if (std::ssize(cell.nodes) > stiffness_kernel_rows)
    throw NumericalError(fmt::format("a background cell is covered by {} nodes; at most {} are handled: the node "
                                     "spacing changes too abruptly",
                                     cell.nodes.size(), stiffness_kernel_rows));
  for (int k = 0; k < std::ssize(cell.nodes); ++k)
    place_[cell.nodes[k]] = k;
  cell.reached.assign(cell.nodes.size(), 0);
  cell.stride = (static_cast<int>(cell.nodes.size()) + 7) / 8 * 8;
  cell.gradients.assign(static_cast<std::size_t>(3 * cell.points) * cell.stride, 0.0);
  for (int q = 0; q < cell.points; ++q) {
    const double root = std::sqrt(points[q].weight);
    double* x = cell.gradients.data() + static_cast<std::size_t>(3 * q) * cell.stride;
    double* y = x + cell.stride;
    double* z = y + cell.stride;
    for (int k = 0; k < at_point_[q].size(); ++k) {
      const int p = place_[at_point_[q].nodes[k]];
      cell.reached[p] |= std::uint32_t{1} << q;
      x[p] = root * at_point_[q].dx[k];
      y[p] = root * at_point_[q].dy[k];
      z[p] = root * at_point_[q].dz[k];
    }
  }
  for (int node : cell.nodes)
    place_[node] = -1;
}

void CellEvaluator::renumber(const std::vector<int>& rank, CellShapes& cell) {
  const int size = static_cast<int>(cell.nodes.size());
  order_.clear();
  for (int k = 0; k < size; ++k)
    order_.emplace_back(rank[cell.nodes[k]], k);
  std::sort(order_.begin(), order_.end());
  gradients_.assign(cell.gradients.size(), 0.0);
  for (int row = 0; row < 3 * cell.points; ++row) {
    const double* from = cell.gradients.data() + static_cast<std::ptrdiff_t>(row) * cell.stride;
    double* to = gradients_.data() + static_cast<std::ptrdiff_t>(row) * cell.stride;
    for (int k = 0; k < size; ++k)
      to[k] = from[order_[k].second];
  }
  std::copy(gradients_.begin(), gradients_.end(), cell.gradients.begin());
  reached_ = cell.reached;
  for (int k = 0; k < size; ++k) {
    cell.nodes[k] = order_[k].first;
    cell.reached[k] = reached_[order_[k].second];
  }
}

} // namespace spherecut::solvers
