// B^T A^-1 B for sparse columns B on a supernodal factor: half the way of a solution, and of that no more than what the
// columns reach.
#pragma once

#include "solvers/algebra/factorisation.hpp"

namespace spherecut::solvers {

/// L of a symmetric positive definite matrix as CHOLMOD holds it: `supernodes` runs of columns that share their rows.
/// Run s: columns first_column[s] to first_column[s + 1] - 1; rows row[first_row[s]] to row[first_row[s + 1] - 1],
/// ascending, the first of them those columns; its entries from value[panel[s]] on, column-major, those above the
/// diagonal are not read.
struct SupernodalFactor {
  int size = 0; // rows of L
  int supernodes = 0;
  const int *first_column = nullptr, *first_row = nullptr, *panel = nullptr, *row = nullptr;
  const double* value = nullptr;
};

/// L^-1 B of columns most of whose entries are zero: no more is worked on than what they reach.
[[nodiscard]] MatrixX sparse_forward(const SupernodalFactor& lower, const MatrixX& columns);

/// (L^-1 B)^T (L^-1 B), all of it set. B has `size` rows.
[[nodiscard]] MatrixX sparse_compliance(const SupernodalFactor& lower, const SparseMatrix& columns);

} // namespace spherecut::solvers
