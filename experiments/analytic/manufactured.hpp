// Displacement fields made up in closed form, with the loads that make them solutions of linear elasticity.
#pragma once

#include "solvers/body/discretisation.hpp"

#include <cstdint>
#include <vector>

namespace spherecut::experiments {

/// u(x) = amplitude sin(wave_vector . x + phase).
struct PlaneWave {
  Vector3 amplitude = Vector3::Zero();   // m
  Vector3 wave_vector = Vector3::Zero(); // 1/m
  double phase = 0;
};

/// u(x) = offset + slope x + sum of plane waves.
struct ManufacturedField {
  solvers::Material material;
  Vector3 offset = Vector3::Zero();
  Matrix3 slope = Matrix3::Zero();
  std::vector<PlaneWave> waves;

  [[nodiscard]] Vector3 displacement(const Vector3& x) const;                    // m
  [[nodiscard]] Matrix3 gradient(const Vector3& x) const;                        // du_i/dx_j
  [[nodiscard]] Matrix3 stress(const Vector3& x) const;                          // Pa
  [[nodiscard]] Vector3 body_force(const Vector3& x) const;                      // N/m3, -div stress
  [[nodiscard]] Vector3 traction(const Vector3& x, const Vector3& normal) const; // Pa, stress . normal
  /// Body force and traction of this field as the loads of a problem.
  [[nodiscard]] solvers::Loads loads() const;
};

/// A linear field with components of order one, in equilibrium without body force: what a patch test reproduces.
ManufacturedField linear_field(const solvers::Material& material, std::uint32_t seed = 7);

/// Four waves of 2.0 to 4.1 radians over the unit cube in random directions. The longitudinal part of each amplitude is
/// scaled by 1 - 2 nu, so that the pressure stays of the order of the shear stress up to nu = 1/2 and the error means
/// the same at every nu.
ManufacturedField smooth_field(const solvers::Material& material, std::uint32_t seed = 7);

} // namespace spherecut::experiments
