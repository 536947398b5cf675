#include "solvers/shapes/cell_shapes.hpp"

#include "solvers/shapes/cut_sight.hpp"
#include "solvers/shapes/interface_ramps.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::solvers {

void CellEvaluator::evaluate(std::span<const QuadraturePoint> points, CellShapes& out) {
  CellShapes& cell = work_; // with room for all candidates; few of them stay
  cell.points = static_cast<int>(points.size());
  cell.stride =
      (cell.points + shape_kernel::points_together - 1) / shape_kernel::points_together * shape_kernel::points_together;
  cell.nodes.clear();
  cell.reached.clear();
  if (!evaluate_together(points, cell))
    evaluate_each(points, cell);
  out = cell;
}

/// The candidates of all points, in ascending order.
void CellEvaluator::find_candidates(std::span<const QuadraturePoint> points, CellShapes& cell) {
  std::array<const int*, most_cell_points> seen{};
  int seen_count = 0, first_word = static_cast<int>(marked_.size()), last_word = -1;
  for (const QuadraturePoint& point : points) {
    const std::span<const int> ids = spheres_.candidates(point.position);
    if (ids.empty() || std::find(seen.begin(), seen.begin() + seen_count, ids.data()) != seen.begin() + seen_count)
      continue;
    seen[seen_count++] = ids.data();
    first_word = std::min(first_word, ids.front() / 64);
    last_word = std::max(last_word, ids.back() / 64);
    for (const int id : ids)
      marked_[id / 64] |= std::uint64_t{1} << id % 64;
  }
  candidates_.clear();
  for (int word = first_word; word <= last_word; ++word)
    for (std::uint64_t bits = std::exchange(marked_[word], 0); bits != 0; bits &= bits - 1) {
      const int id = 64 * word + std::countr_zero(bits);
      const Vector3& x = spheres_.centres()[id];
      const double radius = spheres_.radii()[id];
      cell.nodes.push_back(id);
      candidates_.push_back({x.x(), x.y(), x.z(), 1 / (radius * radius)});
    }
}

/// Keeps the candidates whose spheres hold some point; whether the cut may matter to any of them.
bool CellEvaluator::keep_reached(std::span<const QuadraturePoint> points, CellShapes& cell) {
  const shape_kernel::Kernel& kernel = shape_kernel::dispatched();
  inside_.resize(candidates_.size());
  cell.reached.assign(candidates_.size(), 0);
  for (int b = 0; b < cell.stride / shape_kernel::points_together; ++b) {
    for (int p = 0; p < shape_kernel::points_together; ++p) {
      const int q = shape_kernel::points_together * b + p;
      const QuadraturePoint& point = points[q < cell.points ? q : 0];
      batch_[b].x[p] = point.position.x();
      batch_[b].y[p] = point.position.y();
      batch_[b].z[p] = point.position.z();
      batch_[b].factor[p] = q < cell.points ? std::sqrt(point.weight) : 0;
    }
    const int here = std::min(shape_kernel::points_together, cell.points - shape_kernel::points_together * b);
    kernel.find_inside(candidates_.data(), static_cast<int>(candidates_.size()), batch_[b], inside_.data());
    for (std::size_t k = 0; k < inside_.size(); ++k)
      cell.reached[k] |= (std::uint32_t{inside_[k]} & ((1U << here) - 1)) << shape_kernel::points_together * b;
  }
  int count = 0;
  bool concerned = false;
  for (std::size_t k = 0; k < inside_.size(); ++k)
    if (cell.reached[k] != 0) {
      concerned = concerned || (spheres_.cut() != nullptr && spheres_.cut()->concerns(cell.nodes[k]));
      cell.nodes[count] = cell.nodes[k];
      cell.reached[count] = cell.reached[k];
      candidates_[count++] = candidates_[k];
    }
  cell.nodes.resize(count);
  cell.reached.resize(count);
  return concerned;
}

bool CellEvaluator::evaluate_together(std::span<const QuadraturePoint> points, CellShapes& cell) {
  if (spheres_.basis() != Basis::linear || points.empty())
    return false;
  find_candidates(points, cell);
  const bool concerned = keep_reached(points, cell);
  if (const InterfaceRamps* const ramps = spheres_.ramps(); ramps != nullptr)
    for (const int node : cell.nodes)
      if (ramps->concerns(node))
        return false; // its points have bases of their own
  const auto count = static_cast<int>(cell.nodes.size());
  cell.gradients.resize(static_cast<std::size_t>(3 * count) * cell.stride);
  std::uint32_t altered = 0;
  if (concerned) {
    spheres_.cut()->look(points, cell.nodes, cell.reached, view_);
    altered = view_.altered;
  }
  const shape_kernel::Kernel& kernel = shape_kernel::dispatched();
  const std::uint32_t all = (std::uint32_t{1} << cell.points) - 1;
  const int first_plain = std::countr_one(altered);
  for (int b = 0; b < cell.stride / shape_kernel::points_together; ++b) {
    const int first = shape_kernel::points_together * b;
    // A point that the cut alters gives its place to one that weighs nothing, as those in the room that is left do.
    for (int p = 0; p < shape_kernel::points_together; ++p)
      if (const int q = first + p; altered != 0 && (q >= cell.points || (altered >> q & 1) != 0)) {
        const Vector3& x = points[first_plain < cell.points ? first_plain : 0].position;
        batch_[b].x[p] = x.x();
        batch_[b].y[p] = x.y();
        batch_[b].z[p] = x.z();
        batch_[b].factor[p] = 0;
      }
    if (((all & ~altered) >> first & 0xff) == 0) {
      for (int row = 0; row < 3 * count; ++row)
        std::fill_n(cell.gradients.begin() + static_cast<std::ptrdiff_t>(row) * cell.stride + first,
                    shape_kernel::points_together, 0.0);
      continue;
    }
    alignas(64) std::array<double, shape_kernel::points_together> condition;
    kernel.gradients_at_points(candidates_.data(), count, batch_[b], cell.stride, cell.gradients.data() + first,
                               condition.data());
    for (const double c : condition)
      if (!(c <= spheres_.worst_condition()))
        return false;
  }
  return altered == 0 || add_altered(points, cell);
}

/// Shape functions at a point that the cut alters; false where no support is sound.
bool CellEvaluator::evaluate_altered(const Vector3& x, int q, CellShapes& cell) {
  ShapeFunctions& shape = at_point_[q];
  if ((view_.on_sheet >> q & 1) == 0) {
    const std::size_t count = cell.nodes.size(), stride = count + SphereGrid::lanes;
    double* at = coordinates_.data();
    shape_kernel::Support support{0, ids_.data(), at, at + stride, at + 2 * stride, at + 3 * stride};
    // Every node is written at the end of the list, which moves on only past those that hold the point: no branch.
    int n = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const shape_kernel::Sphere& sphere = candidates_[k];
      support.ids[n] = cell.nodes[k];
      support.dx[n] = sphere.x - x.x();
      support.dy[n] = sphere.y - x.y();
      support.dz[n] = sphere.z - x.z();
      support.q[n] = sphere.q;
      hidden_[n] = static_cast<char>(view_.hidden[k] >> q & 1);
      n += static_cast<int>(cell.reached[k] >> q & 1);
    }
    support.count = n;
    if (spheres_.cut()->evaluate_seen(shape_kernel::dispatched(), x, view_.points[q], hidden_, support,
                                      spheres_.worst_condition(), shape))
      return true;
  }
  return solvers::evaluate(spheres_, x, shape);
}

bool CellEvaluator::add_altered(std::span<const QuadraturePoint> points, CellShapes& cell) {
  const std::size_t count = cell.nodes.size(), stride = count + SphereGrid::lanes;
  ids_.resize(stride);
  coordinates_.resize(4 * stride);
  hidden_.resize(stride);
  for (std::uint32_t bits = view_.altered; bits != 0; bits &= bits - 1)
    if (const int q = std::countr_zero(bits); !evaluate_altered(points[q].position, q, cell))
      return false;

  for (std::size_t k = 0; k < count; ++k) {
    cell.reached[k] &= ~view_.altered;
    place_[cell.nodes[k]] = static_cast<int>(k);
  }
  bool within = true;
  for (std::uint32_t bits = view_.altered; bits != 0; bits &= bits - 1) {
    const int q = std::countr_zero(bits);
    const ShapeFunctions& shape = at_point_[q];
    const double root = std::sqrt(points[q].weight);
    for (int k = 0; k < shape.size(); ++k) {
      const int place = place_[shape.nodes[k]];
      if (place < 0) {
        within = false;
        break;
      }
      cell.reached[place] |= std::uint32_t{1} << q;
      double* to = cell.gradients.data() + 3 * static_cast<std::ptrdiff_t>(place) * cell.stride + q;
      to[0] = root * shape.dx[k];
      to[cell.stride] = root * shape.dy[k];
      to[2 * static_cast<std::ptrdiff_t>(cell.stride)] = root * shape.dz[k];
    }
  }
  for (const int node : cell.nodes)
    place_[node] = -1;
  if (within)
    drop_unreached(cell);
  return within;
}

/// Nodes that no point sees have no part in the cell.
void CellEvaluator::drop_unreached(CellShapes& cell) {
  const std::ptrdiff_t rows = 3 * static_cast<std::ptrdiff_t>(cell.stride);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < cell.nodes.size(); ++k) {
    if (cell.reached[k] == 0)
      continue;
    if (kept != k) {
      cell.nodes[kept] = cell.nodes[k];
      cell.reached[kept] = cell.reached[k];
      std::copy_n(cell.gradients.begin() + static_cast<std::ptrdiff_t>(k) * rows, rows,
                  cell.gradients.begin() + static_cast<std::ptrdiff_t>(kept) * rows);
    }
    ++kept;
  }
  cell.nodes.resize(kept);
  cell.reached.resize(kept);
  cell.gradients.resize(kept * static_cast<std::size_t>(rows));
}

void CellEvaluator::evaluate_each(std::span<const QuadraturePoint> points, CellShapes& cell) {
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
  cell.gradients.assign(3 * cell.nodes.size() * static_cast<std::size_t>(cell.stride), 0.0);
  for (int q = 0; q < cell.points; ++q) {
    const double root = std::sqrt(points[q].weight);
    for (int k = 0; k < at_point_[q].size(); ++k) {
      const int p = place_[at_point_[q].nodes[k]];
      cell.reached[p] |= std::uint32_t{1} << q;
      double* to = cell.gradients.data() + 3 * static_cast<std::ptrdiff_t>(p) * cell.stride + q;
      to[0] = root * at_point_[q].dx[k];
      to[cell.stride] = root * at_point_[q].dy[k];
      to[2 * static_cast<std::ptrdiff_t>(cell.stride)] = root * at_point_[q].dz[k];
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
