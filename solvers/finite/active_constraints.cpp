#include "solvers/finite/active_constraints.hpp"

#include <Eigen/Cholesky>

namespace spherecut::solvers {

void correct(const RestOperator& rest, const std::vector<ActiveConstraint>& constraints, ConstraintResponses& responses,
             VectorX& y) {
  const auto count = std::ssize(constraints);
  if (count == 0)
    return;
  std::vector<const MatrixX*> columns(constraints.size());
  VectorX gaps(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const DisplacementMean& mean = *constraints[i].mean;
    auto known = responses.find(constraints[i].key);
    if (known == responses.end()) {
      MatrixX unit = MatrixX::Zero(y.size(), 3);
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        unit.middleRows<3>(3 * mean.nodes[k]) += mean.weights[k] * Matrix3::Identity();
      known = responses.emplace(constraints[i].key, rest.solve(unit)).first;
    }
    columns[i] = &known->second;
    gaps[i] = constraints[i].direction.dot(mean.of(y));
  }
  MatrixX compliance(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const DisplacementMean& mean = *constraints[i].mean;
    for (Eigen::Index j = 0; j <= i; ++j) {
      Matrix3 between = Matrix3::Zero();
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        between += mean.weights[k] * columns[j]->middleRows<3>(3 * mean.nodes[k]);
      compliance(i, j) = compliance(j, i) = constraints[i].direction.dot(between * constraints[j].direction);
    }
    compliance(i, i) += 1 / constraints[i].stiffness;
  }
  const VectorX forces = compliance.ldlt().solve(gaps);
  for (Eigen::Index i = 0; i < count; ++i)
    y -= *columns[i] * (forces[i] * constraints[i].direction);
}

} // namespace spherecut::solvers
