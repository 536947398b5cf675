#include "solvers/algebra/dense_cholesky.hpp"

#include "solvers/algebra/blas.inl"

#include <cmath>

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

int factor_lower_semidefinite(MatrixX& matrix, const VectorX& scale) {
  const MatrixX whole = matrix;
  if (factor_lower(matrix) < 0 && (matrix.diagonal().cwiseAbs2().array() >= redundant * scale.array()).all())
    return -1;
  matrix = whole;
  const Eigen::Index count = matrix.rows();
  for (Eigen::Index k = 0; k < count; ++k) {
    VectorX below = matrix.col(k).tail(count - k);
    below -= matrix.block(k, 0, count - k, k) * matrix.row(k).head(k).transpose();
    matrix.col(k).setZero();
    if (below[0] > redundant * scale[k])
      matrix.col(k).tail(count - k) = below / std::sqrt(below[0]);
    else if (below[0] > -negative * scale[k])
      matrix(k, k) = superfluous * std::sqrt(scale[k]);
    else
      return static_cast<int>(k);
  }
  return -1;
}

} // namespace spherecut::solvers
