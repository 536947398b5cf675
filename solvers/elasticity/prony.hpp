// Viscoelasticity beside any law: a Prony series fades the isochoric stress, the volumetric part stays elastic
// [Simo 1987; Holzapfel 2000, section 6.10].
//
// With S0 = F^-1 P_iso(F) of the law (its constants are those of a sudden strain), shares g_p and times t_p:
//   S = (1 - sum g_p) S0 + sum H_p,  H_p = g_p integral of exp(-(t - s) / t_p) dS0(s).
// In a step of length dt, S0 runs in a straight line [Taylor, Pister and Goudreau 1970]: with b_p = t_p / dt
// (1 - exp(-dt / t_p)),
//   H_p(new) = exp(-dt / t_p) H_p + g_p b_p (S0(new) - S0),
// so that a step's stress is a P_iso(F) + F H with a number a and a matrix H that do not change in the step: it has an
// energy, a W_iso(F) + 1/2 H : (F^T F - I), and a symmetric tangent. Exact where S0 does run so, held strain included.
// Of the linear law, P_iso itself fades: S0 = P_iso, stress a P_iso + H.
#pragma once

#include "solvers/elasticity/law.hpp"

namespace spherecut::solvers {

/// History of many points; a value that can be copied and put back. Every function throws InputError for spans that do
/// not have as many entries as there are points.
class PronyState {
 public:
  /// At rest, nothing has been strained. `small_strain`: as Law::small_strain_only. Throws InputError for shares
  /// outside (0, 1), shares that add to one and times that are not positive.
  PronyState(std::vector<PronyTerm> terms, std::size_t points, bool small_strain = false);

  /// Starts a step of `duration`, s, from the last accepted state. Throws InputError when it is negative or not finite.
  /// A step of no duration is sudden.
  void begin(double duration);
  /// The number a of the step.
  [[nodiscard]] double factor() const { return factor_; }
  /// The matrix H of the step at a point, Pa.
  [[nodiscard]] Matrix3 history(std::size_t point) const;

  /// Makes the energy and stress of `Law::evaluate_isochoric` at the gradients those of the step.
  void apply(std::span<const Matrix3> gradients, std::span<double> energy, std::span<Matrix3> stress) const;
  /// The same for consecutive points from `first` on; throws InputError where there are not so many.
  void apply(std::size_t first, std::span<const Matrix3> gradients, std::span<double> energy,
             std::span<Matrix3> stress) const;
  /// Makes a tangent of `Law::tangent_isochoric` at a point that of the step.
  void apply(std::size_t point, Matrix9& tangent) const;

  /// Ends the step at these gradients with this stress of `Law::evaluate_isochoric`, as it came from there.
  void accept(std::span<const Matrix3> gradients, std::span<const Matrix3> isochoric_stress);
  /// Makes these gradients ones that have been held for ever: nothing is left to fade.
  void settle(std::span<const Matrix3> gradients, std::span<const Matrix3> isochoric_stress);

  [[nodiscard]] std::size_t points() const { return points_; }
  [[nodiscard]] const std::vector<PronyTerm>& terms() const { return terms_; }
  /// Share of the isochoric stress that stays.
  [[nodiscard]] double lasting_share() const;

 private:
  using Symmetric = std::array<double, 6>; // xx, yy, zz, xy, xz, yz
  void check(std::size_t entries, const char* what) const;
  [[nodiscard]] Symmetric elastic(const Matrix3& gradient, const Matrix3& stress) const; // S0

  std::vector<PronyTerm> terms_;
  std::size_t points_;
  bool small_strain_;
  std::vector<Symmetric> elastic_; // S0 of the accepted state, a point each
  std::vector<Symmetric> fading_;  // H_p of the accepted state, terms of a point together
  double factor_ = 1;
  std::vector<double> decay_, ramp_; // exp(-dt / t_p) and g_p b_p of the step
  std::vector<Symmetric> history_;   // H of the step
};

} // namespace spherecut::solvers
