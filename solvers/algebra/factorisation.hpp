// Sparse direct factorisations kept behind plain Eigen types: symmetric positive definite systems by
// supernodes that CHOLMOD finds, the others by UMFPACK.
#pragma once

#include "topology/base/types.hpp"

#include <Eigen/SparseCore>
#include <memory>

namespace spherecut::solvers {

using SparseMatrix = Eigen::SparseMatrix<double>; // column-major, int indices

/// A factored square matrix.
class Factorisation {
 public:
  virtual ~Factorisation() = default;
  /// Solution of A X = B, one column per right-hand side.
  [[nodiscard]] virtual MatrixX solve(const MatrixX& right_hand_sides) const = 0;
  /// Solution of A^T X = B.
  [[nodiscard]] virtual MatrixX solve_transposed(const MatrixX& right_hand_sides) const = 0;
  [[nodiscard]] virtual long nonzeros() const = 0;
};

/// L L^T of a symmetric positive definite matrix in the order it was given: the parts of it that a Schur complement
/// needs.
class OrderedCholesky : public Factorisation {
 public:
  /// L^-1 B.
  [[nodiscard]] virtual MatrixX forward(const MatrixX& right_hand_sides) const = 0;
  /// The same of columns most of whose entries are zero.
  [[nodiscard]] virtual MatrixX forward_sparse(const MatrixX& right_hand_sides) const = 0;
  /// Solutions X of L^T X = B of which the last `known` rows are there already: the others of `x` are those of B, and
  /// become those of X.
  virtual void backward(int known, MatrixX& x) const = 0;
  /// B^T A^-1 B of sparse columns B.
  [[nodiscard]] virtual MatrixX compliance(const SparseMatrix& columns) const = 0;
  /// The last `count` rows and columns of L, dense; zeros above the diagonal.
  [[nodiscard]] virtual MatrixX trailing(int count) const = 0;
};

/// Supernodal L L^T of a symmetric positive definite matrix given by its lower triangle, which stands in its
/// elimination order (postordered, as fill_reducing_ordering gives it): nothing is permuted. Threads share the work;
/// the bits do not depend on their number. Throws NumericalError naming the column where the matrix is not positive
/// definite.
std::unique_ptr<OrderedCholesky> factor_ordered(const SparseMatrix& lower);

/// L U with partial pivoting and iterative refinement. Throws NumericalError when the matrix is singular.
std::unique_ptr<Factorisation> factor_general(const SparseMatrix& matrix, const std::vector<int>& ordering = {});

/// Largest column sum of absolute values; with `lower_triangle_of_symmetric` entries above the diagonal are not read.
double one_norm(const SparseMatrix& matrix, bool lower_triangle_of_symmetric = false);

/// Estimate of the 1-norm condition number ||A|| ||A^-1|| (Hager 1984, Higham 1988); a lower bound, usually within a
/// factor of three.
double condition_estimate(const Factorisation& factorisation, double norm_of_matrix, int size);

} // namespace spherecut::solvers
