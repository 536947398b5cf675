#include "solvers/algebra/dense_products.hpp"

#include "solvers/algebra/blas.inl"

namespace spherecut::solvers {

namespace {

constexpr int unit = 1; // one column goes without the copies that pay for many

/// `of_rows`: A A^T in place of A^T A.
MatrixX gram(const MatrixX& a, bool of_rows) {
  const int lda = static_cast<int>(a.rows()), n = static_cast<int>(of_rows ? a.rows() : a.cols()),
            k = static_cast<int>(of_rows ? a.cols() : a.rows());
  MatrixX product = MatrixX::Zero(n, n);
  if (n == 0 || k == 0)
    return product;
  const double one = 1, none = 0;
  dsyrk_("L", of_rows ? "N" : "T", &n, &k, &one, a.data(), &lda, &none, product.data(), &n);
  product.triangularView<Eigen::StrictlyUpper>() = product.transpose();
  return product;
}

} // namespace

MatrixX gram(const MatrixX& a) {
  return gram(a, false);
}

MatrixX gram_of_rows(const MatrixX& a) {
  return gram(a, true);
}

void add_product(int rows, int columns, int inner, const double* a, int lda, const double* b, int ldb, double* c,
                 int ldc) {
  const double one = 1;
  if (rows > 0 && columns > 0 && inner > 0)
    dgemm_("N", "N", &rows, &columns, &inner, &one, a, &lda, b, &ldb, &one, c, &ldc);
}

void add_product(double factor, const MatrixX& a, bool transposed, const MatrixX& b, MatrixX& c) {
  const int m = static_cast<int>(c.rows()), n = static_cast<int>(c.cols()), k = static_cast<int>(b.rows()),
            lda = static_cast<int>(a.rows());
  if (transposed) {
    add_transposed_product(factor, a.data(), lda, b, c);
    return;
  }
  if (m == 0 || n == 0 || k == 0)
    return;
  const double one = 1;
  if (n == 1)
    dgemv_("N", &m, &k, &factor, a.data(), &lda, b.data(), &unit, &one, c.data(), &unit);
  else
    dgemm_("N", "N", &m, &n, &k, &factor, a.data(), &lda, b.data(), &k, &one, c.data(), &m);
}

void add_transposed_product(double factor, const double* a, int lda, const MatrixX& b, MatrixX& c) {
  const int m = static_cast<int>(c.rows()), n = static_cast<int>(c.cols()), k = static_cast<int>(b.rows());
  if (m == 0 || n == 0 || k == 0)
    return;
  const double one = 1;
  if (n == 1)
    dgemv_("T", &k, &m, &factor, a, &lda, b.data(), &unit, &one, c.data(), &unit);
  else
    dgemm_("T", "N", &m, &n, &k, &factor, a, &lda, b.data(), &k, &one, c.data(), &m);
}

void triangular_solve(bool transposed, const double* lower, int lda, MatrixX& b) {
  const int rows = static_cast<int>(b.rows()), columns = static_cast<int>(b.cols());
  if (rows == 0 || columns == 0)
    return;
  if (columns == 1) {
    dtrsv_("L", transposed ? "T" : "N", "N", &rows, lower, &lda, b.data(), &unit);
    return;
  }
  const double one = 1;
  dtrsm_("L", "L", transposed ? "T" : "N", "N", &rows, &columns, &one, lower, &lda, b.data(), &rows);
}

void triangular_solve_from_right(const double* lower, int lda, MatrixX& b) {
  const int rows = static_cast<int>(b.rows()), columns = static_cast<int>(b.cols());
  if (rows == 0 || columns == 0)
    return;
  const double one = 1;
  dtrsm_("R", "L", "T", "N", &rows, &columns, &one, lower, &lda, b.data(), &rows);
}

void product_with_transposed(const MatrixX& a, const double* b, int ldb, int rows, MatrixX& c) {
  const int m = static_cast<int>(a.rows()), k = static_cast<int>(a.cols());
  c.resize(m, rows);
  if (m == 0 || rows == 0)
    return;
  const double one = 1, none = 0;
  dgemm_("N", "T", &m, &rows, &k, &one, a.data(), &m, b, &ldb, &none, c.data(), &m);
}

} // namespace spherecut::solvers
