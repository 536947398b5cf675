// Material laws: strain energy and stress as functions of the deformation gradient.
//
// Energy, per volume of the stress-free state, is split as W(F) = W_iso(F) + U(J) with J = det F. Of every law but the
// linear one, U(J) = kappa/4 (J^2 - 1 - 2 ln J) [Simo and Taylor 1991], which is convex and infinite at J = 0. W_iso
// takes shape changes from F J^(-1/3) alone (the fibres of holzapfel_gasser_ogden excepted, see there).
// Matrices of nine numbers are column-major: entry (i, j) at i + 3 j.
#pragma once

#include "topology/base/types.hpp"

#include <array>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace spherecut::solvers {

/// dP_ij/dF_kl at row i + 3 j, column k + 3 l, Pa.
using Matrix9 = Eigen::Matrix<double, 9, 9>;

/// Unit directions of the fibre families in the stress-free state. A law of one family reads the first alone.
struct FibreFrame {
  std::array<Vector3, 2> direction{Vector3::Zero(), Vector3::Zero()};
};

/// Small-strain moduli, Pa, and what follows from them.
struct ElasticConstants {
  double shear_modulus = 0, bulk_modulus = 0;
  [[nodiscard]] double young_modulus() const {
    return 9 * bulk_modulus * shear_modulus / (3 * bulk_modulus + shear_modulus);
  }
  [[nodiscard]] double poisson_ratio() const {
    return (3 * bulk_modulus - 2 * shear_modulus) / (6 * bulk_modulus + 2 * shear_modulus);
  }
};

/// Bulk modulus, Pa, of a shear modulus, Pa, and a Poisson ratio below 0.5.
[[nodiscard]] inline double bulk_modulus_of(double shear_modulus, double poisson_ratio) {
  return 2 * shear_modulus * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio));
}

/// Small strain: W = mu dev e : dev e + kappa/2 (tr e)^2 with e = sym(F) - I. Exact superposition, no rotation. 1 + tr
/// e stands in the place of J.
struct LinearLaw {
  double shear_modulus = 0; // mu, Pa
};
/// W_iso = mu/2 (I1 - 3), with I1 = J^(-2/3) tr F^T F.
struct NeoHookeanLaw {
  double shear_modulus = 0; // mu, Pa
};
/// W_iso = c1 (I1 - 3) + c2 (I1 - 3)^2 + c3 (I1 - 3)^3 [Yeoh 1993]; mu = 2 c1.
struct YeohLaw {
  double c1 = 0, c2 = 0, c3 = 0; // Pa
};
/// W_iso = sum_p mu_p / alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) [Ogden 1972], l the principal stretches
/// times J^(-1/3); mu = 1/2 sum_p mu_p alpha_p. One to three terms.
struct OgdenLaw {
  struct Term {
    double modulus = 0;  // mu_p, Pa
    double exponent = 0; // alpha_p, not 0
  };
  std::vector<Term> terms;
};
/// W_iso = mu/2 (I1 - 3) + sum over the families of k1/(2 k2) (exp(k2 <E>^2) - 1), with E = d (tr C - 3) + (1 - 3 d)
/// (a.C a - 1), C = F^T F, and <E> = max(E, 0): fibres bear tension alone [Holzapfel, Gasser and Ogden 2000; dispersion
/// d of Gasser, Ogden and Holzapfel 2006]. E takes C, not J^(-2/3) C: with the latter a pressure would not stretch
/// fibres and the law would soften in volume [Nolan and others 2014].
struct HolzapfelLaw {
  double shear_modulus = 0;        // mu of the ground matter, Pa
  double fibre_modulus = 0;        // k1, Pa
  double fibre_exponent = 0;       // k2
  double dispersion = 0;           // d, 0 (aligned) to 1/3 (isotropic)
  int families = 1;                // one or two
  bool same_everywhere = true;     // false: every point is given its own frame
  std::vector<Vector3> directions; // of the families, where they are the same everywhere; unit
};

/// One term of a Prony series: the share of the isochoric stress that fades, and in what time.
struct PronyTerm {
  double share = 0; // 0 to 1; all shares add to less than 1
  double time = 0;  // s
};

/// What a law is made of.
struct LawSpec {
  std::variant<LinearLaw, NeoHookeanLaw, YeohLaw, OgdenLaw, HolzapfelLaw> law;
  double bulk_modulus = 0;      // kappa, Pa
  std::vector<PronyTerm> prony; // up to three
};

/// As in a scenario.
[[nodiscard]] const char* law_name(const LawSpec& spec);
/// Moduli in the rest state, Pa; of holzapfel_gasser_ogden those of the ground matter.
[[nodiscard]] ElasticConstants small_strain_moduli(const LawSpec& spec);
/// What a family of fibres adds to the stress along itself per small strain along itself, Pa, where volume is kept:
/// 4 k1 (1 - 3 d)^2.
[[nodiscard]] double fibre_stiffness(const HolzapfelLaw& law);

/// Throws InputError naming law, constant, value and limit: constants that are not finite or of the wrong sign, Poisson
/// ratios outside [0, 0.499] ([0, 0.5) of the linear law), fibres without direction, Prony shares that add to one, and
/// constants with which the law loses strong ellipticity between stretches of 0.5 and 2, with the strain where it does
/// and the value of the constant up to which it does not.
void check_law(const LawSpec& spec);
/// Throws InputError naming the term, its value and the limit.
void check_prony_terms(std::span<const PronyTerm> terms);

/// Hyperelastic law. Constant after it is made: threads may share it.
class Law {
 public:
  Law() = default;
  Law(const Law&) = delete;
  Law& operator=(const Law&) = delete;
  Law(Law&&) = delete;
  Law& operator=(Law&&) = delete;
  virtual ~Law() = default;

  /// Energy W(F), J/m3, and first Piola stress P = dW/dF, Pa, at as many points as there are gradients. `fibres` has a
  /// frame for every point, or is empty: the law's own directions. Where det F <= 0 the energy is infinite and the
  /// stress zero; the linear law alone takes any F. Throws InputError for spans of unequal length.
  virtual void evaluate(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                        std::span<double> energy, std::span<Matrix3> stress) const = 0;
  /// The same without U(J).
  virtual void evaluate_isochoric(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                                  std::span<double> energy, std::span<Matrix3> stress) const = 0;
  /// Derivative of the stress of `evaluate`. Zero where det F <= 0.
  [[nodiscard]] virtual Matrix9 tangent(const Matrix3& gradient, const FibreFrame& fibre) const = 0;
  /// Derivative of the stress of `evaluate_isochoric`.
  [[nodiscard]] virtual Matrix9 tangent_isochoric(const Matrix3& gradient, const FibreFrame& fibre) const = 0;
  /// Frame of the law's own directions; zero where it has none.
  [[nodiscard]] virtual FibreFrame own_fibres() const = 0;

  /// True of the linear law: 1 + tr e in place of J, stress that does not turn with the body.
  [[nodiscard]] virtual bool small_strain_only() const = 0;
  /// U(J), J/m3, U'(J), Pa, and U''(J), Pa.
  [[nodiscard]] virtual double volumetric_energy(double jacobian) const = 0;
  [[nodiscard]] virtual double pressure(double jacobian) const = 0;
  [[nodiscard]] virtual double bulk_slope(double jacobian) const = 0;

  /// Moduli in the rest state; of holzapfel_gasser_ogden those of the ground matter, which fibres stiffen in tension.
  [[nodiscard]] virtual ElasticConstants small_strain() const = 0;
  [[nodiscard]] virtual std::string name() const = 0; // as in a scenario
};

/// Throws InputError as check_law.
std::unique_ptr<Law> make_law(const LawSpec& spec);

} // namespace spherecut::solvers
