// References for the palpation of a hemisphere [De 2001, Figure 3]: an elastic half ball stands on its flat base, which
// is fixed; a rigid cap bonded to it around the pole is pushed down. Everything is for radius 1 m, Young's modulus 1 Pa
// and depth 1 m, so that u = depth * table and F = E * radius * depth * force.
#pragma once

#include "topology/base/types.hpp"

#include <string>
#include <vector>

namespace spherecut::experiments {

/// Radius of the cap over that of the ball, measured from the axis.
inline constexpr double hemisphere_cap_radius = 0.25;

/// Solution on the curved surface. Angles run from the pole (0) to the rim of the base (pi/2).
struct HemisphereReference {
  std::string source;        // which solution this is
  double poisson_ratio = 0;  //
  double force = 0;          // N, push of the cap on the body
  double force_change = 0;   // relative change of the force over the last refinement
  double surface_change = 0; // largest change of a surface displacement over the last refinement, m
  // Entries 2k, 2k + 1, 2k + 2 belong to one quadratic element with its middle entry halfway in angle.
  std::vector<double> angle;  // rad, ascending from 0 to pi/2, dense about the edge of the cap
  std::vector<double> radial; // m, away from the axis
  std::vector<double> axial;  // m, along the axis, positive out of the base: -1 under the cap
  /// Displacement (radial, axial) at an angle, quadratic in each element. Throws InputError outside [0, pi/2].
  [[nodiscard]] Eigen::Vector2d displacement(double at_angle) const;
  /// Displacement of the surface point nearest in direction to x, with the ball centred on the origin and its pole on
  /// the positive z axis.
  [[nodiscard]] Vector3 displacement(const Vector3& x) const;
};

/// Largest difference of surface displacement between two tables (m), over angles two hundredths of a radian apart and
/// the entries of the first.
double largest_difference(const HemisphereReference& a, const HemisphereReference& b);

/// Biquadratic axisymmetric elements, refined until force and surface displacement change by less than `tolerance`
/// (relative to the force and to the depth). Throws NumericalError when five refinements do not reach it. Takes
/// 0 <= nu <= 0.45.
HemisphereReference axisymmetric_hemisphere(double poisson_ratio, double tolerance = 1e-3);

/// The stored table of GetFEM's 27-node bricks for this Poisson ratio (0.3 or 0.45). Throws InputError for others.
HemisphereReference load_hemisphere_reference(double poisson_ratio);

} // namespace spherecut::experiments
