#include "solvers/finite/active_constraints.hpp"

#include <Eigen/Cholesky>

namespace spherecut::solvers {

void find_responses(const RestOperator& rest, const std::vector<int>& keys,
                    const std::vector<const DisplacementMean*>& means, ConstraintResponses& responses) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < keys.size(); ++i)
    if (responses.find(keys[i]) == responses.end())
      missing.push_back(i);
  if (missing.empty())
    return;
  MatrixX units = MatrixX::Zero(rest.matrix().rows(), 3 * std::ssize(missing));
  for (std::size_t m = 0; m < missing.size(); ++m) {
    const DisplacementMean& mean = *means[missing[m]];
    for (std::size_t k = 0; k < mean.nodes.size(); ++k)
      units.block<3, 3>(3 * static_cast<Eigen::Index>(mean.nodes[k]), 3 * static_cast<Eigen::Index>(m)) +=
          mean.weights[k] * Matrix3::Identity();
  }
  const MatrixX solved = rest.solve(units);
  for (std::size_t m = 0; m < missing.size(); ++m)
    responses.emplace(keys[missing[m]], solved.middleCols<3>(3 * static_cast<Eigen::Index>(m)));
}

Matrix3 mean_response(const DisplacementMean& mean, const MatrixX& response) {
  Matrix3 sum = Matrix3::Zero();
  for (std::size_t k = 0; k < mean.nodes.size(); ++k)
    sum += mean.weights[k] * response.middleRows<3>(3 * static_cast<Eigen::Index>(mean.nodes[k]));
  return sum;
}

void correct(const RestOperator& rest, const std::vector<ActiveConstraint>& constraints, ConstraintResponses& responses,
             VectorX& y) {
  const auto count = std::ssize(constraints);
  if (count == 0)
    return;
  std::vector<int> keys;
  std::vector<const DisplacementMean*> means;
  for (const ActiveConstraint& constraint : constraints) {
    keys.push_back(constraint.key);
    means.push_back(constraint.mean);
  }
  find_responses(rest, keys, means, responses);
  std::vector<const MatrixX*> columns(constraints.size());
  VectorX gaps(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    columns[i] = &responses.at(constraints[i].key);
    gaps[i] = constraints[i].direction.dot(constraints[i].mean->of(y));
  }
  MatrixX compliance(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j)
      compliance(i, j) = compliance(j, i) =
          constraints[i].direction.dot(mean_response(*constraints[i].mean, *columns[j]) * constraints[j].direction);
    compliance(i, i) += 1 / constraints[i].stiffness;
  }
  const VectorX forces = compliance.ldlt().solve(gaps);
  for (Eigen::Index i = 0; i < count; ++i)
    y -= *columns[i] * (forces[i] * constraints[i].direction);
}

} // namespace spherecut::solvers
