#include "solvers/points/consistent_gradients.hpp"

#include "solvers/algebra/parallel.hpp"
#include "solvers/points/point_kernels.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/disjoint_sets.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::solvers {

namespace {

/// A vector of three a node, node-major.
using NodeVectors = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

constexpr int groups_together = 64, rows_together = 64;

/// The operator v -> sum_q w_q S_q^T P_q S_q v: S_q takes the nodes that reach q, P_q takes the nearest linear function
/// away.
class LeastChange {
 public:
  LeastChange(const std::vector<Vector3>& nodes, const PointTable& table)
      : nodes_(nodes), table_(table), inverse_(10 * static_cast<std::size_t>(table.groups())),
        scale_(static_cast<std::size_t>(table.groups())), slots_(9 * table.nodes.size()) {
    parallel_ranges(table_.groups(), groups_together, [&](int begin, int end) {
      for (int group = begin; group < end; ++group)
        prepare(group);
    });
    incident_start_.assign(nodes.size() + 1, 0);
    for (const int node : table_.nodes)
      ++incident_start_[node + 1];
    for (std::size_t i = 0; i < nodes.size(); ++i)
      incident_start_[i + 1] += incident_start_[i];
    incident_.resize(table_.nodes.size());
    std::vector<int> next(incident_start_.begin(), incident_start_.end() - 1);
    for (int slot = 0; slot < std::ssize(table_.nodes); ++slot)
      incident_[next[table_.nodes[slot]]++] = slot;
    lay_rows();
    fill_rows();
  }

  /// y = A v.
  void apply(const NodeVectors& v, NodeVectors& y) const {
    parallel_ranges(static_cast<int>(y.rows()), rows_together, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        Vector3 sum = Vector3::Zero();
        for (std::size_t k = row_start_[i]; k < row_start_[i + 1]; ++k)
          sum += values_[k] * Eigen::Map<const Vector3>(v.data() + 3 * static_cast<std::ptrdiff_t>(columns_[k]));
        y.row(i) = sum;
      }
    });
  }

  /// Adds the change that belongs to v to the gradients; returns the sum of w |change|^2.
  double add_to(PointTable& table, const NodeVectors& v) const {
    double size = 0;
    std::vector<LaneValues> change;
    for (int group = 0; group < table.groups(); ++group) {
      changes(group, v, change);
      const std::size_t first = 3 * static_cast<std::size_t>(table.start[group]);
      for (std::size_t k = 0; k < change.size(); ++k)
        for (int lane = 0; lane < table.count[group]; ++lane) {
          table.gradients[first + k].value[lane] += change[k].value[lane];
          size += table.weights[group].value[lane] * change[k].value[lane] * change[k].value[lane];
        }
    }
    return size;
  }

  /// sum_q w g_J(q).
  void integrals(NodeVectors& y) {
    for (int group = 0; group < table_.groups(); ++group)
      for (std::size_t k = 3 * static_cast<std::size_t>(table_.start[group]);
           k < 3 * static_cast<std::size_t>(table_.start[group + 1]); ++k) {
        slots_[k] = 0;
        for (int lane = 0; lane < point_lanes; ++lane)
          slots_[k] += table_.weights[group].value[lane] * table_.gradients[k].value[lane];
      }
    gather(y);
  }

 private:
  [[nodiscard]] bool reaches(int slot, int lane) const { return !table_.gradient(slot, lane).isZero(0); }

  /// Inverse of the moments of p = (1, (x_J - x_q) / size) over the nodes that reach each point, ten numbers a point.
  void prepare(int group) {
    double size = 0;
    const Vector3& middle = table_.positions[static_cast<std::size_t>(point_lanes) * group];
    for (const int node : table_.nodes_of(group))
      size = std::max(size, (nodes_[node] - middle).norm());
    scale_[group] = 1 / size;
    for (int lane = 0; lane < table_.count[group]; ++lane) {
      Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
      const Vector3& x = table_.positions[static_cast<std::size_t>(point_lanes) * group + lane];
      for (int slot = table_.start[group]; slot < table_.start[group + 1]; ++slot)
        if (reaches(slot, lane)) {
          Eigen::Vector4d p;
          p << 1, scale_[group] * (nodes_[table_.nodes[slot]] - x);
          moments += p * p.transpose();
        }
      const Eigen::Matrix4d inverse = moments.inverse();
      for (int a = 0, at = 0; a < 4; ++a)
        for (int b = a; b < 4; ++b, ++at)
          inverse_[10 * static_cast<std::size_t>(group) + at].value[lane] = inverse(a, b);
    }
  }

  /// Nodes that reach a point with each node, in ascending order.
  void lay_rows() {
    std::vector<int> group_of(table_.nodes.size());
    for (int group = 0; group < table_.groups(); ++group)
      std::fill(group_of.begin() + table_.start[group], group_of.begin() + table_.start[group + 1], group);
    row_start_.assign(nodes_.size() + 1, 0);
    std::vector<int> seen(nodes_.size(), -1), row;
    for (int i = 0; i < std::ssize(nodes_); ++i) {
      row.clear();
      for (int k = incident_start_[i]; k < incident_start_[i + 1]; ++k)
        for (const int other : table_.nodes_of(group_of[incident_[k]]))
          if (std::exchange(seen[other], i) != i)
            row.push_back(other);
      std::sort(row.begin(), row.end());
      columns_.insert(columns_.end(), row.begin(), row.end());
      row_start_[i + 1] = columns_.size();
    }
    values_.assign(columns_.size(), 0);
  }

  /// Group after group, so that the sums do not depend on threads.
  void fill_rows() {
    std::vector<std::vector<double>> matrices(groups_together);
    std::vector<int> place(nodes_.size());
    for (int first = 0; first < table_.groups(); first += groups_together) {
      const int last = std::min(first + groups_together, table_.groups());
      parallel_ranges(last - first, 8, [&](int begin, int end) {
        for (int group = first + begin; group < first + end; ++group) {
          const std::span<const int> nodes = table_.nodes_of(group);
          std::vector<double>& matrix = matrices[group - first];
          matrix.resize(nodes.size() * nodes.size());
          linear_leftover(nodes.data(), static_cast<int>(nodes.size()), table_.gradients_of(group), nodes_.data(),
                          table_.positions.data() + static_cast<std::size_t>(point_lanes) * group, scale_[group],
                          inverse_.data() + 10 * static_cast<std::size_t>(group), table_.weights[group], matrix.data());
        }
      });
      for (int group = first; group < last; ++group) {
        const std::span<const int> nodes = table_.nodes_of(group);
        const double* value = matrices[group - first].data();
        for (const int i : nodes) {
          for (std::size_t k = row_start_[i]; k < row_start_[i + 1]; ++k)
            place[columns_[k]] = static_cast<int>(k - row_start_[i]);
          for (const int j : nodes)
            values_[row_start_[i] + place[j]] += *value++;
        }
      }
    }
  }

  /// P_q S_q v at the points of a group: [slot][axis].
  void changes(int group, const NodeVectors& v, std::vector<LaneValues>& change) const {
    const std::span<const int> nodes = table_.nodes_of(group);
    change.resize(3 * nodes.size());
    take_linear(nodes.data(), static_cast<int>(nodes.size()), table_.gradients_of(group), nodes_.data(),
                table_.positions.data() + static_cast<std::size_t>(point_lanes) * group, scale_[group],
                inverse_.data() + 10 * static_cast<std::size_t>(group), v.data(), change.data());
  }

  /// Sums over the slots of each node, in their order.
  void gather(NodeVectors& y) const {
    for (Eigen::Index i = 0; i < y.rows(); ++i) {
      Vector3 sum = Vector3::Zero();
      for (int k = incident_start_[i]; k < incident_start_[i + 1]; ++k)
        sum += Eigen::Map<const Vector3>(slots_.data() + 3 * static_cast<std::size_t>(incident_[k]));
      y.row(i) = sum;
    }
  }

  const std::vector<Vector3>& nodes_;
  const PointTable& table_;
  std::vector<LaneValues> inverse_;
  std::vector<double> scale_; // 1/m, of every group
  std::vector<double> slots_;
  std::vector<int> incident_start_, incident_;
  std::vector<std::size_t> row_start_; // the operator in compressed rows
  std::vector<int> columns_;
  std::vector<double> values_;
};

/// Nodes that groups of points join, piece by piece: a body that is cut apart has several.
std::vector<std::vector<int>> joined_pieces(const PointTable& table, std::size_t count) {
  topology::DisjointSets joined(static_cast<int>(count));
  for (int group = 0; group < table.groups(); ++group) {
    const std::span<const int> nodes = table.nodes_of(group);
    for (const int node : nodes)
      joined.join(node, nodes.front());
  }
  std::vector<std::vector<int>> of_root(count), pieces;
  for (int i = 0; i < static_cast<int>(count); ++i)
    of_root[joined.find(i)].push_back(i);
  for (std::vector<int>& piece : of_root)
    if (!piece.empty())
      pieces.push_back(std::move(piece));
  return pieces;
}

/// The part of each column that no linear function of the places of a piece's nodes has.
void take_linear_away(const std::vector<Vector3>& nodes, const std::vector<int>& piece, NodeVectors& y) {
  const auto count = static_cast<Eigen::Index>(piece.size());
  Eigen::Matrix<double, Eigen::Dynamic, 4> linear(count, 4);
  NodeVectors here(count, 3);
  Vector3 mean = Vector3::Zero();
  for (const int node : piece)
    mean += nodes[node] / static_cast<double>(count);
  double size = 0;
  for (const int node : piece)
    size = std::max(size, (nodes[node] - mean).norm());
  for (Eigen::Index i = 0; i < count; ++i) {
    linear.row(i) << 1, (nodes[piece[i]] - mean).transpose() / std::max(size, 1e-300);
    here.row(i) = y.row(piece[i]);
  }
  here -= linear * linear.completeOrthogonalDecomposition().solve(here);
  for (Eigen::Index i = 0; i < count; ++i)
    y.row(piece[i]) = here.row(i);
}

} // namespace

std::vector<Vector3> surface_integrals(const Spheres& spheres, std::span<const SurfacePoint> surface) {
  std::vector<Vector3> result(spheres.size(), Vector3::Zero());
  ShapeFunctions shape;
  for (const SurfacePoint& point : surface) {
    if (!evaluate(spheres, point.position, shape))
      throw NumericalError(fmt::format("no sound support covers the surface point ({:.6g}, {:.6g}, {:.6g}) m",
                                       point.position.x(), point.position.y(), point.position.z()));
    for (int k = 0; k < shape.size(); ++k)
      result[shape.nodes[k]] += point.weight * shape.value[k] * point.normal;
  }
  return result;
}

ConsistencyReport make_consistent(const std::vector<Vector3>& nodes, const std::vector<Vector3>& boundary,
                                  PointTable& table, double tolerance, int most_iterations) {
  ConsistencyReport report;
  LeastChange change(nodes, table);
  const auto count = static_cast<Eigen::Index>(nodes.size());
  NodeVectors integral(count, 3), target(count, 3);
  change.integrals(integral);
  const std::vector<std::vector<int>> pieces = joined_pieces(table, nodes.size());
  for (Eigen::Index i = 0; i < count; ++i)
    target.row(i) = boundary[i];
  // sum_J x_J b_J^T over a piece is its volume by the surface; where its points have another one, theirs counts.
  for (const std::vector<int>& piece : pieces) {
    Matrix3 by_surface = Matrix3::Zero(), by_points = Matrix3::Zero();
    for (const int node : piece) {
      by_surface += nodes[node] * boundary[node].transpose();
      by_points += nodes[node] * integral.row(node);
    }
    const double volume = by_points.trace() / 3;
    if (!(volume > 0))
      continue;
    const Matrix3 missing = Matrix3::Identity() - by_surface / volume;
    for (const int node : piece)
      target.row(node) += (integral.row(node) * missing).eval();
  }
  const double size = target.norm();
  NodeVectors residual = target - integral;
  for (const std::vector<int>& piece : pieces)
    take_linear_away(nodes, piece, residual);
  report.before = residual.norm() / size;
  NodeVectors v = NodeVectors::Zero(count, 3), direction = residual, product(count, 3);
  Eigen::Array3d square = residual.colwise().squaredNorm().transpose();
  NodeVectors best = v;
  // Directions that are all but linear on every point's nodes: steps along them would be as large as they are useless.
  double typical = 0;
  for (int group = 0; group < table.groups(); ++group)
    for (int lane = 0; lane < table.count[group]; ++lane)
      typical += table.weights[group].value[lane] * static_cast<double>(table.nodes_of(group).size());
  const double least_curvature = 1e-7 * typical / static_cast<double>(count);
  double least = residual.norm();
  const Eigen::Array3d enough = Eigen::Array3d::Constant(std::pow(tolerance * size, 2));
  while (report.iterations < most_iterations && (square > enough).any()) {
    change.apply(direction, product);
    const Eigen::Array3d curvature = direction.cwiseProduct(product).colwise().sum().transpose();
    Eigen::Array3d step;
    for (int axis = 0; axis < 3; ++axis)
      step[axis] =
          curvature[axis] > least_curvature * direction.col(axis).squaredNorm() ? square[axis] / curvature[axis] : 0;
    if ((step == 0).all()) // what is left no change of the gradients can reach
      break;
    v += direction * step.matrix().asDiagonal();
    residual -= product * step.matrix().asDiagonal();
    const Eigen::Array3d next = residual.colwise().squaredNorm().transpose();
    Eigen::Array3d ratio;
    for (int axis = 0; axis < 3; ++axis)
      ratio[axis] = square[axis] > 0 ? next[axis] / square[axis] : 0;
    direction = residual + direction * ratio.matrix().asDiagonal();
    square = next;
    ++report.iterations;
    if (std::sqrt(next.sum()) < least) {
      least = std::sqrt(next.sum());
      best = v;
    }
  }
  double all = 0;
  for (int group = 0; group < table.groups(); ++group)
    for (std::size_t k = 3 * static_cast<std::size_t>(table.start[group]);
         k < 3 * static_cast<std::size_t>(table.start[group + 1]); ++k)
      for (int lane = 0; lane < table.count[group]; ++lane)
        all += table.weights[group].value[lane] * std::pow(table.gradients[k].value[lane], 2);
  report.change = std::sqrt(change.add_to(table, best) / all);
  change.integrals(integral);
  report.after = (target - integral).norm() / size;
  if (!(report.after < report.before)) { // no help: as they were
    change.add_to(table, -best);
    report.after = report.before;
    report.change = 0;
  }
  return report;
}

} // namespace spherecut::solvers
