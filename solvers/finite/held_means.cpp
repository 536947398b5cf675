#include "solvers/finite/held_means.hpp"

#include <algorithm>

namespace spherecut::solvers {

HeldMeans::HeldMeans(std::vector<Prescribed> entries, std::vector<DisplacementMean> means, const std::vector<int>& own,
                     int functions)
    : entries_(std::move(entries)), means_(std::move(means)) {
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<int> here;
    for (int e = 0; e < std::ssize(entries_); ++e)
      if (entries_[e].components[axis])
        here.push_back(e);
    if (here.empty())
      continue;
    const auto alike =
        std::find_if(groups_.begin(), groups_.end(), [&](const Axes& group) { return group.entries == here; });
    if (alike != groups_.end()) {
      alike->axes.push_back(axis);
      continue;
    }
    Axes group;
    group.axes = {axis};
    group.entries = here;
    std::vector<int> place(functions, -1);
    for (const int e : here) {
      place[own[e]] = static_cast<int>(group.nodes.size());
      group.nodes.push_back(own[e]);
    }
    std::vector<Eigen::Triplet<double>> followers, others;
    for (int row = 0; row < std::ssize(here); ++row) {
      const DisplacementMean& mean = means_[here[row]];
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        if (place[mean.nodes[k]] >= 0)
          followers.emplace_back(row, place[mean.nodes[k]], mean.weights[k]);
        else
          others.emplace_back(row, mean.nodes[k], mean.weights[k]);
    }
    const auto count = static_cast<Eigen::Index>(here.size());
    SparseMatrix matrix(count, count);
    matrix.setFromTriplets(followers.begin(), followers.end());
    group.own = factor_general(matrix);
    group.others.resize(count, functions);
    group.others.setFromTriplets(others.begin(), others.end());
    groups_.push_back(std::move(group));
  }
}

void HeldMeans::complete(VectorX& coefficients, std::span<const Vector3> values) const {
  for (const Axes& group : groups_) {
    MatrixX right = MatrixX::Zero(std::ssize(group.entries), std::ssize(group.axes));
    for (Eigen::Index a = 0; a < right.cols(); ++a) {
      const int axis = group.axes[a];
      if (!values.empty())
        for (Eigen::Index row = 0; row < right.rows(); ++row)
          right(row, a) = values[group.entries[row]][axis];
      const Eigen::Map<const VectorX, 0, Eigen::InnerStride<3>> along(coefficients.data() + axis,
                                                                      coefficients.size() / 3);
      right.col(a) -= group.others * along;
    }
    const MatrixX own = group.own->solve(right);
    for (Eigen::Index a = 0; a < right.cols(); ++a)
      for (Eigen::Index row = 0; row < right.rows(); ++row)
        coefficients[3 * group.nodes[row] + group.axes[a]] = own(row, a);
  }
}

std::vector<Vector3> HeldMeans::reduce(VectorX& forces) const {
  std::vector<Vector3> reactions(entries_.size(), Vector3::Zero());
  for (const Axes& group : groups_) {
    MatrixX held(std::ssize(group.entries), std::ssize(group.axes));
    for (Eigen::Index a = 0; a < held.cols(); ++a)
      for (Eigen::Index row = 0; row < held.rows(); ++row) {
        double& force = forces[3 * group.nodes[row] + group.axes[a]];
        held(row, a) = force;
        force = 0;
      }
    const MatrixX multipliers = group.own->solve_transposed(held);
    for (Eigen::Index a = 0; a < held.cols(); ++a) {
      for (Eigen::Index row = 0; row < held.rows(); ++row)
        reactions[group.entries[row]][group.axes[a]] = multipliers(row, a);
      Eigen::Map<VectorX, 0, Eigen::InnerStride<3>> along(forces.data() + group.axes[a], forces.size() / 3);
      along -= group.others.transpose() * multipliers.col(a);
    }
  }
  return reactions;
}

void HeldMeans::clear_held(VectorX& v) const {
  for (const Axes& group : groups_)
    for (const int node : group.nodes)
      for (const int axis : group.axes)
        v[3 * node + axis] = 0;
}

} // namespace spherecut::solvers
