#include "solvers/finite/rest_operator.hpp"

namespace spherecut::solvers {

RestOperator::RestOperator(const FiniteBody& body, const VectorX& coefficients, const RestOperator* other, double shift)
    : rank_(body.rank()) {
  body.tangent(coefficients, penalty, lower_);
  if (other != nullptr && shift > 0)
    Eigen::Map<VectorX>(lower_.valuePtr(), lower_.nonZeros()) +=
        shift * Eigen::Map<const VectorX>(other->lower_.valuePtr(), other->lower_.nonZeros());
  factor_ = factor_ordered(lower_);
}

MatrixX RestOperator::solve(const MatrixX& right) const {
  MatrixX ordered(right.rows(), right.cols());
  for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
    ordered.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i])) = right.middleRows<3>(3 * i);
  const MatrixX solved = factor_->solve(ordered);
  for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
    ordered.middleRows<3>(3 * i) = solved.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i]));
  return ordered;
}

void RestOperator::solve(const VectorX& right, VectorX& solution) const {
  solution = solve(MatrixX(right));
}

double RestOperator::condition() const {
  return condition_estimate(*factor_, one_norm(lower_, true), static_cast<int>(lower_.rows()));
}

} // namespace spherecut::solvers
