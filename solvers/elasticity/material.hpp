// Isotropic linear elasticity.
#pragma once

namespace spherecut::solvers {

struct Material {
  double young_modulus = 1e4;  // E, Pa, > 0
  double poisson_ratio = 0.45; // nu, 0 <= nu < 0.5
  double density = 1060;       // kg/m3, used by gravity alone
  [[nodiscard]] double shear_modulus() const { return young_modulus / (2 * (1 + poisson_ratio)); }
  [[nodiscard]] double lame_lambda() const {
    return young_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  }
  /// Whether supports and integrals have to keep the volume: nu >= 0.45.
  [[nodiscard]] bool is_nearly_incompressible() const { return poisson_ratio >= 0.45; }
  /// Throws InputError when E <= 0 or nu is outside [0, 0.5).
  void check() const;
};

} // namespace spherecut::solvers
