// Numeric Cholesky factorisation of a sparse matrix whose supernodes are known, shared among threads.
#pragma once

#include "solvers/algebra/sparse_compliance.hpp"

namespace spherecut::solvers {

/// Writes L of A = L L^T into `value`, which has room for the panels of all supernodes of `structure` (its own `value`
/// is not read). `lower` holds the lower triangle of A in the order of elimination. Entries of a panel above the
/// diagonal are set to numbers without meaning. Returns the first column whose pivot is not positive, or -1. The bits
/// of L do not depend on the number of threads.
[[nodiscard]] int factor_supernodes(const SparseMatrix& lower, const SupernodalFactor& structure, double* value);

} // namespace spherecut::solvers
