#include "solvers/finite/rest_operator.hpp"

#include "solvers/finite/cut_functions.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/incision.hpp"

namespace spherecut::solvers {

namespace {

// A border takes less than a factor of the whole, and little more memory, as long as it is so small.
constexpr long uncut_of_appended = 2; // functions of the uncut body to one of the cut, at least
constexpr long entries_of_factor = 2; // of the half solutions to one of the factor, at most

bool is_uncut(const FiniteBody& body) {
  const topology::Incision* const incision = body.problem().incision.get();
  return body.cut_functions()->appended() == 0 && (incision == nullptr || incision->sheets().empty());
}

} // namespace

RestOperator::RestOperator(const FiniteBody& body, const CutLineage& before) : body_(body), at_(body.stress_free()) {
  const CutFunctions* const cut = body.cut_functions();
  std::optional<UniformTangent> uniform;
  if (cut != nullptr) {
    uniform = body.uniform_tangent(at_);
    lineage_.uncut = cut->uncut();
    if (before.uncut == lineage_.uncut)
      lineage_.tangent = before.tangent;
  }
  if (uniform && cut->appended() > 0 && lineage_.tangent != nullptr && lineage_.tangent->fits(body, *uniform) &&
      border(*uniform, before))
    return;
  factor();
  if (uniform && is_uncut(body))
    lineage_.tangent = std::make_shared<const UncutTangent>(body, *uniform, factor_, one_norm(lower_, true));
}

/// False: the cut is too large for the body, or rounding has left nothing definite; the whole has the last word.
bool RestOperator::border(const UniformTangent& uniform, const CutLineage& before) {
  const long size = lineage_.uncut->size(), appended = body_.cut_functions()->appended();
  if (uncut_of_appended * appended > size ||
      9 * size * appended > entries_of_factor * lineage_.tangent->factor().nonzeros())
    return false;
  for (const KeptBorder* kept : {before.border.get(), static_cast<const KeptBorder*>(nullptr)})
    try {
      bordered_ = std::make_unique<const BorderedOperator>(body_, lineage_.tangent, kept, uniform, penalty);
      lineage_.border = bordered_->border();
      return true;
    } catch (const NumericalError&) {
      if (kept == nullptr)
        return false;
    }
  return false;
}

RestOperator::RestOperator(const FiniteBody& body, const VectorX& coefficients, const RestOperator* other, double shift)
    : body_(body), at_(coefficients) {
  if (other != nullptr && shift > 0) {
    static_cast<void>(matrix());
    const SparseMatrix& added = other->matrix();
    Eigen::Map<VectorX>(lower_.valuePtr(), lower_.nonZeros()) +=
        shift * Eigen::Map<const VectorX>(added.valuePtr(), added.nonZeros());
  }
  factor();
}

void RestOperator::factor() {
  factor_ = factor_ordered(matrix());
}

const SparseMatrix& RestOperator::matrix() const {
  if (lower_.nonZeros() == 0)
    body_.tangent(at_, penalty, lower_);
  return lower_;
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

// Of a bordered one with the norm of the uncut body's matrix: assembling the whole would take longer than the rest.
double RestOperator::condition() const {
  if (bordered_ != nullptr)
    return condition_estimate(*bordered_, lineage_.tangent->norm(), static_cast<int>(rows()));
  return condition_estimate(*factor_, one_norm(lower_, true), static_cast<int>(rows()));
}

} // namespace spherecut::solvers
