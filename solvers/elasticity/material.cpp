#include "solvers/elasticity/material.hpp"

#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

void Material::check() const {
  if (!(young_modulus > 0) || !std::isfinite(young_modulus))
    throw InputError(fmt::format("material: Young's modulus is {} Pa; it must be positive and finite", young_modulus));
  if (!(poisson_ratio >= 0) || !(poisson_ratio < 0.5))
    throw InputError(fmt::format("material: Poisson's ratio is {}; it must lie in [0, 0.5)", poisson_ratio));
  if (!(density >= 0) || !std::isfinite(density))
    throw InputError(fmt::format("material: density is {} kg/m3; it must not be negative", density));
}

} // namespace spherecut::solvers
