#include "solvers/cell_shapes.hpp"

#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

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

std::vector<int> cells_by_place(const BackgroundCells& cells) {
  BoundingBox bounds{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
  for (const BackgroundBox& box : cells.boxes) {
    bounds.lower = bounds.lower.cwiseMin(box.centre);
    bounds.upper = bounds.upper.cwiseMax(box.centre);
  }
  constexpr int bits = 16;
  const double scale = ((1 << bits) - 1) / std::max(bounds.extent().maxCoeff(), 1e-300);
  const auto code_of = [&](const Vector3& x) {
    std::uint64_t code = 0;
    for (int c = 0; c < 3; ++c) {
      const auto place = static_cast<std::uint64_t>((x[c] - bounds.lower[c]) * scale);
      for (int b = 0; b < bits; ++b)
        code |= (place >> b & 1) << (3 * b + c);
    }
    return code;
  };
  std::vector<std::pair<std::uint64_t, int>> by_code;
  by_code.reserve(cells.boxes.size());
  for (int b = 0; b < std::ssize(cells.boxes); ++b)
    by_code.emplace_back(code_of(cells.boxes[b].centre), b);
  std::sort(by_code.begin(), by_code.end());
  std::vector<int> order;
  for (const auto& entry : by_code)
    for (int c = cells.boxes[entry.second].first_cell; c < cells.boxes[entry.second].last_cell; ++c)
      order.push_back(c);
  return order;
}

} // namespace spherecut::solvers
