#include "solvers/cell_shapes.hpp"

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

bool CellCluster::has_room_for(const CellShapes& cell) const {
  if (parts_.empty())
    return true;
  if (points_ + cell.points > stiffness_kernel_points)
    return false;
  const auto fresh = std::count_if(cell.nodes.begin(), cell.nodes.end(), [&](int node) { return place_[node] < 0; });
  return std::ssize(nodes_) + fresh <= stiffness_kernel_rows;
}

void CellCluster::add(const CellShapes& cell, double sign, int id) {
  cells_.push_back(id);
  for (std::size_t k = 0; k < cell.nodes.size(); ++k) {
    int& place = place_[cell.nodes[k]];
    if (place < 0) {
      place = static_cast<int>(nodes_.size());
      nodes_.push_back(cell.nodes[k]);
      reached_.push_back(0);
    }
    reached_[place] |= std::uint64_t{cell.reached[k]} << points_;
  }
  parts_.push_back({&cell, sign});
  signs_.insert(signs_.end(), cell.points, sign);
  points_ += cell.points;
}

void CellCluster::clear() {
  for (int node : nodes_)
    place_[node] = -1;
  parts_.clear();
  cells_.clear();
  nodes_.clear();
  reached_.clear();
  signs_.clear();
  points_ = 0;
}

void CellCluster::gather(const std::vector<int>& rank) {
  order_.clear();
  for (int node : nodes_)
    order_.emplace_back(rank[node], node);
  std::sort(order_.begin(), order_.end());
  std::vector<std::uint64_t> reached(reached_.size());
  for (std::size_t k = 0; k < order_.size(); ++k) {
    const int node = order_[k].second;
    reached[k] = reached_[place_[node]];
    nodes_[k] = node;
  }
  reached_ = std::move(reached);
  for (std::size_t k = 0; k < nodes_.size(); ++k)
    place_[nodes_[k]] = static_cast<int>(k);
  stride_ = (static_cast<int>(nodes_.size()) + 7) / 8 * 8;
  gradients_.assign(static_cast<std::size_t>(3 * points_) * stride_, 0.0);
  double* to = gradients_.data();
  for (const Part& part : parts_) {
    const CellShapes& cell = *part.cell;
    const int rows = 3 * cell.points, count = static_cast<int>(cell.nodes.size());
    for (int k = 0; k < count; ++k)
      order_[k].first = place_[cell.nodes[k]];
    for (int row = 0; row < rows; ++row, to += stride_) {
      const double* from = cell.gradients.data() + static_cast<std::ptrdiff_t>(row) * cell.stride;
      for (int k = 0; k < count; ++k)
        to[order_[k].first] = from[k];
    }
  }
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
