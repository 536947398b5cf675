// A state of one body as another begins from it, which has other nodes somewhere, or a longer cut.
#pragma once

#include "solvers/finite/body.hpp"

namespace spherecut::solvers {

/// The coefficients, m, 3 a node, with those of the `free` nodes (one flag a node) replaced: they bring the deformation
/// gradient nearest to a given one,
///
///   sum_q w_q |F(x_q) - F_given(x_q)|^2 -> min over the points that free nodes reach.
///
/// Displacements of nodes alone would not do: where shape functions have changed they make F jump, down to J < 0 in
/// what is folded. Points where J is below `least_jacobian` afterwards count for more in another fit, for a few rounds,
/// and the nodes that reach them become free. Throws NumericalError where a free node reaches no point, and what
/// `given` throws.
VectorX nearest_state(const FiniteBody& body, VectorX coefficients, std::vector<char> free,
                      const std::function<Matrix3(const Vector3& x)>& given, double least_jacobian = 0.1);

} // namespace spherecut::solvers
