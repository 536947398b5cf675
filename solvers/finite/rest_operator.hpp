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

  /// The tangent of the stress-free body. Where cuts append and the body without a cut has been factored, that factor
  /// is bordered by what the cut appends (solvers/finite/bordered_operator.hpp). The body must outlive this.
  explicit RestOperator(const FiniteBody& body);
  /// The tangent at `coefficients`, or where `shift` > 0 that plus `shift` times `other`. Throws NumericalError where
  /// it is not positive definite.
  RestOperator(const FiniteBody& body, const VectorX& coefficients, const RestOperator* other = nullptr,
               double shift = 0);

  [[nodiscard]] Eigen::Index rows() const { return 3 * static_cast<Eigen::Index>(body_.functions()); }
  /// K^-1 of one column, or several, in the order of the functions.
  void solve(const VectorX& right, VectorX& solution) const;
  [[nodiscard]] MatrixX solve(const MatrixX& right) const;
  /// Condition number, estimated.
  [[nodiscard]] double condition() const;
  /// Whether it borders the factor of the uncut body.
  [[nodiscard]] bool is_bordered() const { return bordered_ != nullptr; }

 private:
  void factor();
  [[nodiscard]] SparseMatrix matrix() const; // lower, in order of elimination

  const FiniteBody& body_;
  VectorX at_; // coefficients of the tangent
  SparseMatrix lower_;
  std::shared_ptr<const OrderedCholesky> factor_;
  std::unique_ptr<const Factorisation> bordered_; // in place of these
};

} // namespace spherecut::solvers
