// A law that is made of functions: energy, stress and tangent of many deformation gradients at once. What is left out
// is made by differences. For laws that are tried out: the laws of law.hpp are faster.
#pragma once

#include "solvers/elasticity/law.hpp"
#include "topology/base/errors.hpp"

#include <functional>

namespace spherecut::solvers {

/// The functions get gradients F with det F > 0 alone, and fill as many results as there are gradients. They may be
/// called by several threads at once, always with the same gradients together whatever the number of threads.
struct LawFunctions {
  /// W(F), J/m3. Infinite where the law cannot be asked: such states are not gone to.
  std::function<void(std::span<const Matrix3> gradients, std::span<double> energy)> energy;
  /// P = dW/dF, Pa. Empty: 36 energies a point, central differences of fourth order in steps of 1e-3.
  std::function<void(std::span<const Matrix3> gradients, std::span<Matrix3> stress)> stress;
  /// dP/dF, Pa. Empty: 36 stresses a point, the same differences.
  std::function<void(std::span<const Matrix3> gradients, std::span<Matrix9> tangent)> tangent;
  /// kappa, Pa. Above 0: what the functions say is W_iso, and U(J) of law.hpp is added to it; near nu = 0.5 bodies then
  /// take the pressure of blocks. 0: the functions say everything.
  double bulk_modulus = 0;
  std::string name = "functions";
};

/// A value of one of the functions that cannot be used. The message has function, value and F.
class LawValueError : public InputError {
 public:
  LawValueError(const std::string& message, std::size_t point) : InputError(message), point_(point) {}
  [[nodiscard]] std::size_t point() const { return point_; } // of the gradients that the law was asked for

 private:
  std::size_t point_;
};

/// Throws the error as an InputError that has the place too, x in m of the body at rest.
[[noreturn]] void throw_with_place(const LawValueError& error, const Vector3& x);

/// Of a neo-Hookean law strained by 5 and by 25 %, steps of 1e-3 leave of a stress by differences 1e-11 and 1e-10 mu,
/// of a tangent by differences of given stresses 4e-11 and 2e-9 mu, and by differences of differences 6e-10 and 3e-9
/// mu.
///
/// Throws InputError, naming function, F, value and limit: no energy; a bulk modulus that is negative or not finite; at
/// rest and at six strained states values that are not finite, a stress at rest above 1e-6 mu, a stress that is not the
/// slope of the energy, a tangent that is not that of the stress (both to 1e-4); moduli at rest that are not positive.
/// Later, LawValueError from the law. It takes no fibre frames: InputError.
std::unique_ptr<Law> make_function_law(LawFunctions functions);

} // namespace spherecut::solvers
