#include "solvers/finite/active_constraints.hpp"

#include <Eigen/Cholesky>

namespace spherecut::solvers {

void correct(const RestOperator& rest, const std::vector<ActiveConstraint>& constraints, ConstraintResponses& responses,
             VectorX& y) {
  const auto count = std::ssize(constraints);
  if (count == 0)
    return;
  struct Springs { // of one mean
    const DisplacementMean* mean;
    const MatrixX* columns;
    Eigen::Index begin, end; // constraints
  };
  std::vector<Springs> sprung;
  VectorX gaps(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const DisplacementMean& mean = *constraints[i].mean;
    gaps[i] = constraints[i].direction.dot(mean.of(y));
    if (!sprung.empty() && sprung.back().mean == &mean) {
      sprung.back().end = i + 1;
      continue;
    }
    auto known = responses.find(constraints[i].key);
    if (known == responses.end()) {
      MatrixX unit = MatrixX::Zero(y.size(), 3);
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        unit.middleRows<3>(3 * mean.nodes[k]) += mean.weights[k] * Matrix3::Identity();
      known = responses.emplace(constraints[i].key, rest.solve(unit)).first;
    }
    sprung.push_back({&mean, &known->second, i, i + 1});
  }
  MatrixX compliance(count, count);
  for (std::size_t a = 0; a < sprung.size(); ++a) {
    const DisplacementMean& mean = *sprung[a].mean;
    for (std::size_t b = 0; b <= a; ++b) {
      Matrix3 between = Matrix3::Zero();
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        between += mean.weights[k] * sprung[b].columns->middleRows<3>(3 * mean.nodes[k]);
      for (Eigen::Index i = sprung[a].begin; i < sprung[a].end; ++i)
        for (Eigen::Index j = sprung[b].begin; j < sprung[b].end; ++j)
          compliance(i, j) = compliance(j, i) = constraints[i].direction.dot(between * constraints[j].direction);
    }
  }
  for (Eigen::Index i = 0; i < count; ++i)
    compliance(i, i) += 1 / constraints[i].stiffness;
  const VectorX forces = compliance.ldlt().solve(gaps);
  for (const Springs& springs : sprung) {
    Vector3 force = Vector3::Zero();
    for (Eigen::Index i = springs.begin; i < springs.end; ++i)
      force += forces[i] * constraints[i].direction;
    y -= *springs.columns * force;
  }
}

} // namespace spherecut::solvers
