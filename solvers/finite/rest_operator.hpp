// The factored tangent of a body at rest, which preconditions the search for its equilibria. It is carried along by the
// deformation: d = A K0^-1 A^T r with A = F / J at every node.
#pragma once

#include "solvers/finite/body.hpp"

namespace spherecut::solvers {

class RestOperator {
 public:
  /// Penalty of held means in the factored matrix, over mu h: large enough that what is left of their compliance does
  /// not count, as the solver meets them exactly by itself.
  static constexpr double penalty = 1e4;

  /// The tangent at `coefficients`, or where `shift` > 0 that plus `shift` times `other`. Throws NumericalError where
  /// it is not positive definite.
  RestOperator(const FiniteBody& body, const VectorX& coefficients, const RestOperator* other = nullptr,
               double shift = 0);

  [[nodiscard]] const SparseMatrix& matrix() const { return lower_; }
  /// K^-1 of one column in node order.
  void solve(const VectorX& right, VectorX& solution) const;
  [[nodiscard]] MatrixX solve(const MatrixX& right) const;
  /// Condition number, estimated.
  [[nodiscard]] double condition() const;

 private:
  const std::vector<int>& rank_;
  SparseMatrix lower_;
  std::unique_ptr<OrderedCholesky> factor_;
};

} // namespace spherecut::solvers
