// Cholesky factors of dense matrices.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

/// The lower Cholesky factor of a symmetric matrix given by its lower triangle takes its place; zeros above. Returns
/// the first column that is not positive, or -1.
int factor_lower(MatrixX& matrix);

/// The same of a semidefinite matrix: an unknown of which others leave less than 1e-13 of its `scale` (one an unknown,
/// its own energy) is superfluous, and stays zero in every solution. Of those that repeat one another it is the
/// faintest. Returns the first column that is negative beyond rounding, or -1.
/// `any_left_out` (may be null): whether there was such an unknown. It is one because of what comes after it as well:
/// no part of the factor is then that of a part of the matrix.
int factor_lower_semidefinite(MatrixX& matrix, const VectorX& scale, bool* any_left_out = nullptr);

} // namespace spherecut::solvers
