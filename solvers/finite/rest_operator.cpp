#include "solvers/finite/rest_operator.hpp"

#include "solvers/finite/bordered_operator.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "topology/base/errors.hpp"

namespace spherecut::solvers {

namespace {

constexpr int uncut_of_appended = 2; // unknowns of the uncut body to one of the cut: with fewer the whole is factored

} // namespace

RestOperator::RestOperator(const FiniteBody& body) : body_(body), at_(body.stress_free()) {
  const CutFunctions* const cut = body.cut_functions();
  const std::optional<UniformTangent> uniform = cut != nullptr ? body.uniform_tangent(at_) : std::nullopt;
  if (uniform && cut->appended() > 0 && uncut_of_appended * cut->appended() < cut->uncut()->size())
    if (std::shared_ptr<const UncutTangent> uncut = cut->uncut()->tangent();
        uncut != nullptr && uncut->fits(body, *uniform)) {
      try {
        bordered_ = std::make_unique<const BorderedOperator>(body, std::move(uncut), *uniform, penalty);
        return;
      } catch (const NumericalError&) { // the whole has the last word
      }
    }
  factor();
  if (uniform && cut->appended() == 0)
    cut->uncut()->keep(std::make_shared<const UncutTangent>(body, *uniform, factor_));
}

RestOperator::RestOperator(const FiniteBody& body, const VectorX& coefficients, const RestOperator* other, double shift)
    : body_(body), at_(coefficients) {
  if (other != nullptr && shift > 0) {
    const SparseMatrix added = other->matrix();
    lower_ = matrix();
    Eigen::Map<VectorX>(lower_.valuePtr(), lower_.nonZeros()) +=
        shift * Eigen::Map<const VectorX>(added.valuePtr(), added.nonZeros());
  }
  factor();
}

void RestOperator::factor() {
  if (lower_.nonZeros() == 0)
    lower_ = matrix();
  factor_ = factor_ordered(lower_);
}

SparseMatrix RestOperator::matrix() const {
  if (lower_.nonZeros() > 0)
    return lower_;
  SparseMatrix lower;
  body_.tangent(at_, penalty, lower);
  return lower;
}

MatrixX RestOperator::solve(const MatrixX& right) const {
  if (bordered_ != nullptr)
    return bordered_->solve(right);
  const std::vector<int>& rank = body_.rank();
  MatrixX ordered(right.rows(), right.cols());
  for (Eigen::Index i = 0; i < std::ssize(rank); ++i)
    ordered.middleRows<3>(3 * static_cast<Eigen::Index>(rank[i])) = right.middleRows<3>(3 * i);
  const MatrixX solved = factor_->solve(ordered);
  for (Eigen::Index i = 0; i < std::ssize(rank); ++i)
    ordered.middleRows<3>(3 * i) = solved.middleRows<3>(3 * static_cast<Eigen::Index>(rank[i]));
  return ordered;
}

void RestOperator::solve(const VectorX& right, VectorX& solution) const {
  solution = solve(MatrixX(right));
}

double RestOperator::condition() const {
  const Factorisation& whole = bordered_ != nullptr ? *bordered_ : static_cast<const Factorisation&>(*factor_);
  return condition_estimate(whole, one_norm(matrix(), true), 3 * body_.functions());
}

} // namespace spherecut::solvers
