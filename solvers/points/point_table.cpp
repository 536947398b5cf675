#include "solvers/points/point_table.hpp"

#include "solvers/algebra/parallel.hpp"
#include "solvers/shapes/cell_shapes.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

namespace {

/// The lanes of one group out of a cell's gradients; nodes that reach none of its points are left out.
void append_group(const CellShapes& shapes, std::span<const QuadraturePoint> points, int first, int cell,
                  const Spheres& spheres, PointTable& table) {
  const int here = std::min(point_lanes, static_cast<int>(points.size()) - first);
  LaneValues weights, scale;
  Vector3 centroid = Vector3::Zero();
  double volume = 0;
  for (int lane = 0; lane < point_lanes; ++lane) {
    const QuadraturePoint& point = points[first + (lane < here ? lane : 0)];
    table.positions.push_back(point.position);
    if (lane >= here)
      continue;
    weights.value[lane] = point.weight;
    scale.value[lane] = 1 / std::sqrt(point.weight);
    centroid += point.weight * point.position;
    volume += point.weight;
  }
  centroid /= volume;
  const std::uint32_t mask = ((std::uint32_t{1} << here) - 1) << first;
  for (std::size_t k = 0; k < shapes.nodes.size(); ++k) {
    if ((shapes.reached[k] & mask) == 0)
      continue;
    const int node = shapes.nodes[k];
    table.nodes.push_back(node);
    const double* from = shapes.gradients.data() + 3 * k * static_cast<std::size_t>(shapes.stride) + first;
    for (int axis = 0; axis < 3; ++axis, from += shapes.stride) {
      LaneValues& to = table.gradients.emplace_back();
      for (int lane = 0; lane < here; ++lane)
        to.value[lane] = scale.value[lane] * from[lane];
    }
    const double distance = (centroid - spheres.centres()[node]).norm() / spheres.radii()[node];
    table.shares.push_back(volume * std::max(quartic_spline(distance), 1e-3));
  }
  table.start.push_back(static_cast<int>(table.nodes.size()));
  table.weights.push_back(weights);
  table.count.push_back(here);
  table.cell.push_back(cell);
}

} // namespace

PointTable tabulate_points(const BackgroundCells& cells, const Spheres& spheres) {
  constexpr int grain = 64;
  const std::vector<int> order = cells_by_place(cells);
  const int count = static_cast<int>(order.size());
  std::vector<PointTable> parts((count + grain - 1) / grain);
  parallel_ranges(count, grain, [&](int begin, int end) {
    CellEvaluator evaluator(spheres);
    CellShapes shapes;
    PointTable& part = parts[begin / grain];
    for (int k = begin; k < end; ++k) {
      const std::span<const QuadraturePoint> points = cells.of(order[k]);
      evaluator.evaluate(points, shapes);
      for (int first = 0; first < std::ssize(points); first += point_lanes)
        append_group(shapes, points, first, order[k], spheres, part);
    }
  });
  PointTable table;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const PointTable& part : parts) {
    const int slots = table.start.back();
    for (std::size_t g = 1; g < part.start.size(); ++g)
      table.start.push_back(slots + part.start[g]);
    append(table.nodes, part.nodes);
    append(table.gradients, part.gradients);
    append(table.shares, part.shares);
    append(table.weights, part.weights);
    append(table.count, part.count);
    append(table.cell, part.cell);
    append(table.positions, part.positions);
  }
  return table;
}

} // namespace spherecut::solvers
