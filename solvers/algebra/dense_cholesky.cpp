#include "solvers/algebra/dense_cholesky.hpp"

#include "solvers/algebra/blas.inl"

#include <algorithm>
#include <cmath>
#include <vector>

namespace spherecut::solvers {

namespace {

constexpr double redundant = 1e-13; // of an unknown's scale: what the others leave of it is rounding
constexpr double negative = 1e-9;   // of it: beyond rounding, the matrix is not semidefinite
constexpr double superfluous = 1e9; // pivot of an unknown that is left out, in roots of its scale

} // namespace

int factor_lower(MatrixX& matrix) {
  const int n = static_cast<int>(matrix.rows());
  if (n == 0)
    return -1;
  int info = 0;
  dpotrf_("L", &n, matrix.data(), &n, &info);
  matrix.triangularView<Eigen::StrictlyUpper>().setZero();
  return info > 0 ? info - 1 : -1;
}

namespace {

/// Unknowns of which the others leave nothing, taken from the largest pivot down: of those that repeat one another it
/// is the faintest that is left out. Those that are not left out get 0; -1 - k: unknown k has a negative energy.
int find_redundant(const MatrixX& lower, const VectorX& scale, std::vector<char>& is_redundant) {
  const MatrixX whole = lower.selfadjointView<Eigen::Lower>();
  const Eigen::Index count = whole.rows();
  MatrixX columns(count, count);
  VectorX left = whole.diagonal();
  is_redundant.assign(static_cast<std::size_t>(count), 1);
  for (Eigen::Index step = 0; step < count; ++step) {
    Eigen::Index next = -1;
    for (Eigen::Index k = 0; k < count; ++k)
      if (is_redundant[k] != 0 && left[k] > redundant * scale[k] && (next < 0 || left[k] > left[next]))
        next = k;
    if (next < 0)
      break;
    is_redundant[next] = 0;
    VectorX column = whole.col(next);
    column -= columns.leftCols(step) * columns.row(next).head(step).transpose();
    columns.col(step) = column / std::sqrt(left[next]);
    left -= columns.col(step).cwiseAbs2();
  }
  for (Eigen::Index k = 0; k < count; ++k)
    if (is_redundant[k] != 0 && !(left[k] >= -negative * scale[k]))
      return static_cast<int>(-1 - k);
  return 0;
}

} // namespace

int factor_lower_semidefinite(MatrixX& matrix, const VectorX& scale, bool* any_left_out) {
  if (any_left_out != nullptr)
    *any_left_out = false;
  const MatrixX whole = matrix;
  if (factor_lower(matrix) < 0 && (matrix.diagonal().cwiseAbs2().array() >= redundant * scale.array()).all())
    return -1;
  std::vector<char> is_redundant;
  if (const int found = find_redundant(whole, scale, is_redundant); found < 0)
    return -1 - found;
  if (any_left_out != nullptr)
    *any_left_out = std::find(is_redundant.begin(), is_redundant.end(), 1) != is_redundant.end();
  matrix = whole;
  for (Eigen::Index k = 0; k < matrix.rows(); ++k)
    if (is_redundant[k] != 0) {
      matrix.row(k).setZero();
      matrix.col(k).setZero();
      matrix(k, k) = superfluous * superfluous * (scale[k] > 0 ? scale[k] : 1);
    }
  return factor_lower(matrix);
}

} // namespace spherecut::solvers
