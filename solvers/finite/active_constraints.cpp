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
  MatrixX units = MatrixX::Zero(rest.rows(), 3 * std::ssize(missing));
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
  struct Springs { // of one mean
    const DisplacementMean* mean;
    const MatrixX* columns;
    Eigen::Index begin, end; // constraints
  };
  std::vector<Springs> sprung;
  VectorX gaps(count);
  std::vector<int> keys;
  std::vector<const DisplacementMean*> means;
  for (Eigen::Index i = 0; i < count; ++i) {
    const DisplacementMean& mean = *constraints[i].mean;
    gaps[i] = constraints[i].direction.dot(mean.of(y));
    if (!sprung.empty() && sprung.back().mean == &mean) {
      sprung.back().end = i + 1;
      continue;
    }
    keys.push_back(constraints[i].key);
    means.push_back(&mean);
    sprung.push_back({&mean, nullptr, i, i + 1});
  }
  find_responses(rest, keys, means, responses);
  for (std::size_t a = 0; a < sprung.size(); ++a)
    sprung[a].columns = &responses.at(keys[a]);
  MatrixX compliance(count, count);
  for (std::size_t a = 0; a < sprung.size(); ++a)
    for (std::size_t b = 0; b <= a; ++b) {
      const Matrix3 between = mean_response(*sprung[a].mean, *sprung[b].columns);
      for (Eigen::Index i = sprung[a].begin; i < sprung[a].end; ++i)
        for (Eigen::Index j = sprung[b].begin; j < sprung[b].end; ++j)
          compliance(i, j) = compliance(j, i) = constraints[i].direction.dot(between * constraints[j].direction);
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
