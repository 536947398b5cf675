// Notation: n inward unit normal, r = x - origin, rho = |r|, z = r.n depth, s = r - z n tangential position,
// P = F.n, Q = F - P n normal and tangential force, mu shear modulus, nu Poisson ratio.
//
// Johnson's component formulas for P along z and Q along x add up to one vector:
//   4 pi mu u = F/rho + r (r.F)/rho^3
//             + (1 - 2 nu) [ P n/rho - P s/(rho (rho + z)) + Q/(rho + z) - s (Q.s)/(rho (rho + z)^2) + n (Q.s)/(rho
//             (rho + z)) ]
// The first line is what is left at nu = 1/2; the bracket keeps the surface free of traction for other nu.
#include "solvers/contact/half_space.hpp"

#include "topology/base/errors.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace spherecut::solvers {

Vector3 half_space_displacement(const Material& material, const Vector3& force, const Vector3& origin,
                                const Vector3& inward_normal, const Vector3& x) {
  material.check();
  const Vector3& n = inward_normal;
  if (!(std::abs(n.norm() - 1) < 1e-9))
    throw InputError(fmt::format("half-space: inward normal has length {} (must be 1)", n.norm()));
  const Vector3 r = x - origin;
  const double rho = r.norm(), z = r.dot(n);
  if (!(rho > 0) || !std::isfinite(rho))
    throw InputError(
        fmt::format("half-space: displacement asked at distance {} m from the point force (must be > 0)", rho));
  if (z < -0.5 * rho)
    throw InputError(fmt::format("half-space: point is {} m outside the surface, at {} m from the point force "
                                 "(limit: half that distance)",
                                 -z, rho));
  const Vector3 s = r - z * n;
  const double P = force.dot(n);
  const Vector3 Q = force - P * n;
  const double sum = rho + z, q = Q.dot(s);
  const Vector3 common = force / rho + r * (r.dot(force) / (rho * rho * rho));
  const Vector3 bracket = n * (P / rho + q / (rho * sum)) - s * (P / (rho * sum) + q / (rho * sum * sum)) + Q / sum;
  return (common + (1 - 2 * material.poisson_ratio) * bracket) / (4 * std::numbers::pi * material.shear_modulus());
}

} // namespace spherecut::solvers
