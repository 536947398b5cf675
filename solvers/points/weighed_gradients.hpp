// Gradients of a cell's points as a matrix whose Gram matrix has the moments sum_q w_q g_i g_j^T of the functions
// there.
#pragma once

#include "solvers/points/point_table.hpp"

#include <cmath>

namespace spherecut::solvers {

/// Gradients at the points of the groups from `first` to before `end`, times the root of the weight, m^(1/2): a row a
/// point, three columns for each of `columns`. `add_each(function, add)` calls add(column) for every column to which
/// the gradient of a function is added.
template <class AddEach>
MatrixX weighed_gradients(const PointTable& table, int first, int end, Eigen::Index columns, const AddEach& add_each) {
  MatrixX weighed = MatrixX::Zero(static_cast<Eigen::Index>(point_lanes) * (end - first), 3 * columns);
  for (int group = first; group < end; ++group) {
    double root[point_lanes];
    for (int lane = 0; lane < point_lanes; ++lane)
      root[lane] = std::sqrt(table.weights[group].value[lane]);
    const auto row = static_cast<Eigen::Index>(point_lanes) * (group - first);
    const std::span<const int> functions = table.nodes_of(group);
    const LaneValues* const gradients = table.gradients_of(group);
    for (std::size_t k = 0; k < functions.size(); ++k)
      add_each(functions[k], [&](Eigen::Index column) {
        for (int c = 0; c < 3; ++c) {
          double* const to = &weighed(row, 3 * column + c);
          for (int lane = 0; lane < point_lanes; ++lane)
            to[lane] += root[lane] * gradients[3 * k + c].value[lane];
        }
      });
  }
  return weighed;
}

} // namespace spherecut::solvers
