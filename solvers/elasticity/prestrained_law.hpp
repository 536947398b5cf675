// The law of a body that is given in a strained shape: F is counted from that shape, and stress from the stress-free
// state of every point, F_e = F F_0 (multiplicative pre-strain).
#pragma once

#include "solvers/elasticity/law.hpp"

namespace spherecut::solvers {

/// W'(F) = W(F F_0) / det F_0, J per m3 of the given shape, with F_0 the elastic deformation of that shape, the same
/// everywhere. Directions of fibres, the law's own among them, are those in the given shape; det F too. Throws
/// InputError for a missing law, the linear one (which has an initial strain), and F_0 that is not finite or has det
/// F_0 outside [0.1, 10].
std::shared_ptr<const Law> prestrained(std::shared_ptr<const Law> law, const Matrix3& elastic);

} // namespace spherecut::solvers
