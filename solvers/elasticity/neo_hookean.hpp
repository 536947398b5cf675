// Neo-Hookean law, isochoric part: W = mu/2 (I1 - 3).
#pragma once

#include "solvers/elasticity/deformation.hpp"
#include "solvers/elasticity/law.hpp"

namespace spherecut::solvers {

struct NeoHookeanModel {
  NeoHookeanLaw constants;
  static constexpr bool has_volumetric_part = true;
  static constexpr int families = 0;
  static constexpr const char* name = "neo_hookean";
  [[nodiscard]] double shear_modulus() const { return constants.shear_modulus; }

  /// Energy; the stress to `stress`.
  template <class T, class Real>
  T isochoric(const Deformation<T>& d, const Real* /*fibres*/, T* stress) const {
    const T shape = d.jacobian_to(-2.0 / 3), trace = d.trace();
    stress_of_first_invariant(d, shape, trace, T(0.5 * constants.shear_modulus), stress);
    return 0.5 * constants.shear_modulus * (shape * trace - 3.0);
  }
};

} // namespace spherecut::solvers
