// A crack along a spherical cap, by axisymmetric elements.
#pragma once

#include "experiments/reference/axisymmetric.hpp"

#include "solvers/fracture/stress_intensity.hpp"

namespace spherecut::experiments {

/// K_I and K_II along the rim of a cap of half angle `half_angle` (rad, in (0, pi / 2)) in a ball of about `far` rim
/// radii whose surface is displaced as hydrostatic tension of 1 Pa displaces an uncut ball, for a rim of radius 1 m;
/// the
/// + side is the outer one, away from the sphere's centre. `fine` (8 or more): elements in every direction grow with
/// it. The limit of a flat disc is within 0.1 % of 2 / sqrt(pi). Throws InputError for values out of their range.
solvers::Intensities lens_by_elements(const solvers::Material& material, double half_angle, double far, int fine = 16);

} // namespace spherecut::experiments
