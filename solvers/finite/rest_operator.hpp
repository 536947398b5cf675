// The factored tangent of a body at rest, which preconditions the search for its equilibria. It is carried along by the
// deformation: d = A K0^-1 A^T r with A = F / J at every node.
#pragma once

#include "solvers/finite/bordered_operator.hpp"

namespace spherecut::solvers {

class RestOperator {
 public:
  /// Penalty of held means in the factored matrix, over mu h: large enough that what is left of their compliance does
  /// not count, as the solver meets them exactly by itself.
  static constexpr double penalty = 1e4;

  /// The tangent of the stress-free body. Where cuts append and `before` has the factor of the uncut body, that is
  /// bordered by what the cut appends. The body must outlive this.
  explicit RestOperator(const FiniteBody& body, const CutLineage& before = {});
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
  /// Null: it does not border the factor of the uncut body.
  [[nodiscard]] const BorderedOperator* bordered() const { return bordered_.get(); }
  /// For the body with a longer cut.
  [[nodiscard]] const CutLineage& lineage() const { return lineage_; }

 private:
  bool border(const UniformTangent& uniform, const CutLineage& before);
  void factor();
  [[nodiscard]] const SparseMatrix& matrix() const; // lower, in order of elimination

  const FiniteBody& body_;
  VectorX at_;                 // coefficients of the tangent
  mutable SparseMatrix lower_; // empty: not asked for yet
  std::shared_ptr<const OrderedCholesky> factor_;
  std::unique_ptr<const BorderedOperator> bordered_; // in place of these
  CutLineage lineage_;
};

} // namespace spherecut::solvers
