// Partial elimination of a general sparse matrix behind plain Eigen types (MUMPS: UMFPACK gives out no Schur
// complement, and solving for all its columns costs ten times the elimination).
#pragma once

#include "solvers/algebra/factorisation.hpp"

namespace spherecut::solvers {

/// L U of all unknowns F of a matrix but for a few kept ones W. Objects of this kind, also different ones, compute one
/// at a time: those of other threads wait.
class PartialFactorisation {
 public:
  virtual ~PartialFactorisation() = default;
  /// A_WW - A_WF A_FF^-1 A_FW, in the order in which the kept unknowns were given. Can be taken once.
  [[nodiscard]] virtual MatrixX take_complement() = 0;
  /// A_FF^-1 B, or A_FF^-T B: rows of kept unknowns are not read, and zero in the result.
  [[nodiscard]] virtual MatrixX solve_eliminated(const MatrixX& right_hand_sides, bool transposed) const = 0;
  /// Entries of the factors, the complement included.
  [[nodiscard]] virtual long nonzeros() const = 0;
};

/// `ordering`: in which sequence the unknowns are eliminated, kept ones anywhere; empty: found. Throws NumericalError
/// when A_FF is singular.
std::unique_ptr<PartialFactorisation> factor_partly(const SparseMatrix& matrix, const std::vector<int>& kept,
                                                    const std::vector<int>& ordering = {});

} // namespace spherecut::solvers
