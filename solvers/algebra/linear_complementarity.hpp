// Small dense linear complementarity problems of unilateral contact.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

struct ComplementaritySolution {
  VectorX forces;           // lambda >= 0
  std::vector<char> active; // lambda > 0 allowed
  int pivots = 0;
  bool converged = false;
};

/// Finds lambda >= 0 with w = matrix lambda + gap >= 0 and lambda . w = 0. `matrix` need not be symmetric; for a
/// P-matrix the solution is unique and found: block pivoting, with Murty's least-index rule when blocks stop making
/// progress [Judice and Pires 1994]. `start` (may be empty) is a guess of the active set. `tolerance` is on the gap, m.
ComplementaritySolution solve_complementarity(const MatrixX& matrix, const VectorX& gap, const std::vector<char>& start,
                                              double tolerance);

} // namespace spherecut::solvers
