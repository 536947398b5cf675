#include "experiments/analytic/half_space.hpp"

#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

using std::numbers::pi;

double contact_modulus(const solvers::Material& material) {
  material.check();
  return material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
}

void check_lengths(double radius, double depth) {
  if (!(radius > 0) || !std::isfinite(radius))
    throw InputError(fmt::format("contact: tool radius is {} m (must be positive)", radius));
  if (!(depth >= 0) || !std::isfinite(depth))
    throw InputError(fmt::format("contact: depth is {} m (must not be negative)", depth));
}

} // namespace

double flat_punch_force(const solvers::Material& material, double radius, double depth) {
  check_lengths(radius, depth);
  return 2 * contact_modulus(material) * radius * depth;
}

double flat_punch_profile(double radius, double depth, double r) {
  check_lengths(radius, depth);
  return r <= radius ? depth : 2 * depth / pi * std::asin(radius / r);
}

double flat_punch_pressure(const solvers::Material& material, double radius, double depth, double r) {
  check_lengths(radius, depth);
  return r < radius ? contact_modulus(material) * depth / (pi * std::sqrt(radius * radius - r * r)) : 0;
}

double bonded_punch_factor(double poisson_ratio) {
  if (!(poisson_ratio >= 0) || !(poisson_ratio <= 0.5))
    throw InputError(fmt::format("bonded punch: Poisson's ratio is {} (allowed: 0 to 0.5)", poisson_ratio));
  const double compressibility = 1 - 2 * poisson_ratio;
  if (compressibility < 1e-12)
    return 1;
  return (1 - poisson_ratio) * std::log1p(2 * compressibility) / compressibility;
}

HertzContact hertz_contact(const solvers::Material& material, double sphere_radius, double depth) {
  check_lengths(sphere_radius, depth);
  const double modulus = contact_modulus(material), radius = std::sqrt(sphere_radius * depth);
  return {4.0 / 3 * modulus * radius * depth, radius, 2 * modulus * radius / (pi * sphere_radius)};
}

double hertz_profile(double sphere_radius, double depth, double r) {
  check_lengths(sphere_radius, depth);
  const double a2 = sphere_radius * depth, r2 = r * r;
  if (r2 <= a2)
    return depth - r2 / (2 * sphere_radius);
  return ((2 * a2 - r2) * std::asin(std::sqrt(a2 / r2)) + std::sqrt(a2) * std::sqrt(r2 - a2)) / (pi * sphere_radius);
}

} // namespace spherecut::experiments
