// Products of large dense matrices by BLAS: Eigen's own run on the vectors that every x86-64 has.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

/// A^T A; all of it is set.
[[nodiscard]] MatrixX gram(const MatrixX& a);
/// A A^T; all of it is set.
[[nodiscard]] MatrixX gram_of_rows(const MatrixX& a);
/// C += factor A B, or factor A^T B. The shapes must fit.
void add_product(double factor, const MatrixX& a, bool transposed, const MatrixX& b, MatrixX& c);
/// C += A B of matrices given by their first entries and leading dimensions: `rows` x `inner` and `inner` x `columns`.
void add_product(int rows, int columns, int inner, const double* a, int lda, const double* b, int ldb, double* c,
                 int ldc);
/// C += factor A^T B, A with leading dimension `lda`, of as many rows as B and columns as C has rows.
void add_transposed_product(double factor, const double* a, int lda, const MatrixX& b, MatrixX& c);
/// Columns of B become L^-1 B, or L^-T B, of a lower triangle with leading dimension `lda`.
void triangular_solve(bool transposed, const double* lower, int lda, MatrixX& b);
/// Rows of B become those of B L^-T, of a lower triangle with leading dimension `lda`.
void triangular_solve_from_right(const double* lower, int lda, MatrixX& b);
/// C = A B^T, B of `rows` rows and as many columns as A, with leading dimension `ldb`. C is resized.
void product_with_transposed(const MatrixX& a, const double* b, int ldb, int rows, MatrixX& c);

} // namespace spherecut::solvers
