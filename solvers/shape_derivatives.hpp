// Shape functions of either basis with first and, if wanted, second derivatives: the general form beside the hot kernel
// of the linear basis (shape_kernel.hpp, whose key holds here).
#pragma once

#include "solvers/shape_kernel.hpp"

namespace spherecut::solvers {

/// Number of basis functions: 4 or 10.
constexpr int basis_size(Basis basis) {
  return basis == Basis::linear ? 4 : 10;
}

/// Fills value, gradient, moment_condition and, when `second` is set, the second derivatives of `out` (arrays resized
/// to the support; nodes are left alone). A singular moment matrix gives an infinite moment_condition.
void evaluate_general(const shape_kernel::Support& support, Basis basis, bool second, ShapeFunctions& out);

} // namespace spherecut::solvers
