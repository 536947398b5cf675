// Shape functions of the quadratic basis with first and, if wanted, second derivatives. The linear basis has its own
// kernel (shape_kernel.hpp, whose key holds here).
#pragma once

#include "solvers/shapes/kernel.hpp"

namespace spherecut::solvers {

/// Number of basis functions: 4 or 10.
constexpr int basis_size(Basis basis) {
  return basis == Basis::linear ? 4 : 10;
}

/// Fills value, gradient, moment_condition and, when `second` is set, the second derivatives of `out`, whose arrays
/// have the size of the support. A singular moment matrix gives an infinite moment_condition.
void evaluate_quadratic(const shape_kernel::Support& support, bool second, ShapeFunctions& out);

} // namespace spherecut::solvers
