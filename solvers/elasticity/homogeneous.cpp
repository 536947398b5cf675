#include "solvers/elasticity/homogeneous.hpp"

#include "solvers/elasticity/dual.hpp"
#include "solvers/elasticity/law_checks.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

namespace spherecut::solvers::homogeneous {
namespace {

using Three = Dual<3>;
using ThreeStresses = std::array<Three, 3>;

Three power_of(const Three& a, double exponent) {
  return exponential(exponent * logarithm(a));
}

/// E of a family, or zero where it is slack, from a.C a and tr C.
template <class T>
T fibre_strain(const HolzapfelLaw& law, const T& square, const T& trace) {
  return positive_part(law.dispersion * (trace - 3.0) + (1 - 3 * law.dispersion) * (square - 1.0));
}

/// lambda_i dW_iso/dlambda_i, of fibres too.
struct Principal {
  const ThreeStresses& stretch;

  [[nodiscard]] Three trace() const {
    return stretch[0] * stretch[0] + stretch[1] * stretch[1] + stretch[2] * stretch[2];
  }
  [[nodiscard]] Three jacobian() const { return stretch[0] * stretch[1] * stretch[2]; }

  /// W_iso = w(I1) with w' = slope: 2 w' (l_i^2 - I1 / 3), l of J^(-1/3) F.
  [[nodiscard]] ThreeStresses of_first_invariant(const Three& slope) const {
    const Three shape = power_of(jacobian(), -2.0 / 3), mean = trace() / 3.0;
    ThreeStresses t;
    for (int i = 0; i < 3; ++i)
      t[i] = 2.0 * slope * shape * (stretch[i] * stretch[i] - mean);
    return t;
  }
  ThreeStresses operator()(const NeoHookeanLaw& law) const { return of_first_invariant(0.5 * law.shear_modulus); }
  ThreeStresses operator()(const YeohLaw& law) const {
    const Three e = power_of(jacobian(), -2.0 / 3) * trace() - 3.0;
    return of_first_invariant(law.c1 + 2.0 * law.c2 * e + 3.0 * law.c3 * e * e);
  }
  ThreeStresses operator()(const OgdenLaw& law) const {
    ThreeStresses t;
    const Three size = power_of(jacobian(), -1.0 / 3);
    for (const OgdenLaw::Term& term : law.terms) {
      ThreeStresses power;
      for (int i = 0; i < 3; ++i)
        power[i] = power_of(size * stretch[i], term.exponent);
      const Three mean = (power[0] + power[1] + power[2]) / 3.0;
      for (int i = 0; i < 3; ++i)
        t[i] += term.modulus * (power[i] - mean);
    }
    return t;
  }
  ThreeStresses operator()(const HolzapfelLaw& law) const {
    ThreeStresses t = of_first_invariant(0.5 * law.shear_modulus);
    for (const Vector3& a : law.directions) {
      Three square;
      for (int i = 0; i < 3; ++i)
        square += a[i] * a[i] * stretch[i] * stretch[i];
      const Three e = fibre_strain(law, square, trace());
      const Three pull = 2.0 * law.fibre_modulus * e * exponential(law.fibre_exponent * e * e);
      for (int i = 0; i < 3; ++i)
        t[i] += pull * (law.dispersion + (1 - 3 * law.dispersion) * a[i] * a[i]) * stretch[i] * stretch[i];
    }
    return t;
  }
  ThreeStresses operator()(const LinearLaw& law) const { // Hooke: P_i, not l_i P_i
    ThreeStresses t;
    const Three mean = (stretch[0] + stretch[1] + stretch[2]) / 3.0;
    for (int i = 0; i < 3; ++i)
      t[i] = 2.0 * law.shear_modulus * (stretch[i] - mean);
    return t;
  }
};

ThreeStresses principal(const LawSpec& spec, const ThreeStresses& stretch) {
  const Principal principal{stretch};
  ThreeStresses t = std::visit(principal, spec.law);
  if (std::holds_alternative<LinearLaw>(spec.law)) {
    for (Three& stress : t)
      stress += spec.bulk_modulus * (stretch[0] + stretch[1] + stretch[2] - 3.0);
    return t;
  }
  const Three j = principal.jacobian();
  for (int i = 0; i < 3; ++i)
    t[i] = (t[i] + 0.5 * spec.bulk_modulus * (j * j - 1.0)) / stretch[i]; // J U' = kappa/2 (J^2 - 1)
  return t;
}

/// Fibres must leave the stress diagonal: along axes, or mirrored, when they are strained alike and what each adds off
/// the diagonal cancels.
void check_fibres(const LawSpec& spec) {
  const auto* law = std::get_if<HolzapfelLaw>(&spec.law);
  if (!law)
    return;
  if (!law->same_everywhere || law->directions.empty())
    throw InputError("homogeneous state: the fibres have no direction of their own");
  Matrix3 sum = Matrix3::Zero();
  bool alike = true, along_axes = true;
  for (const Vector3& a : law->directions) {
    sum += a * a.transpose();
    alike = alike && (a.cwiseAbs() - law->directions.front().cwiseAbs()).norm() < 1e-9;
    along_axes = along_axes && a.cwiseAbs().maxCoeff() > 1 - 1e-12;
  }
  sum.diagonal().setZero();
  if (!along_axes && !(alike && sum.norm() < 1e-9))
    throw InputError("homogeneous state: the fibres lie askew; along axes, or two families that mirror each other, the "
                     "stress is diagonal");
}

Matrix3 diagonal_of(const Vector3& v) {
  return v.asDiagonal();
}

/// Newton's method for the free stretches, in their logarithms, from the last stretch: the given one is reached by
/// steps of at most 5 %. `given` has the stretches at a share 0 .. 1 of the way, those that `free` marks left out.
template <class Given>
State solve_free(const LawSpec& spec, const char* what, double stretch, std::array<bool, 3> free, const Given& given) {
  check_fibres(spec);
  if (!(stretch > 0) || !std::isfinite(stretch))
    throw InputError(fmt::format("homogeneous state, {}: the stretch is {}; it must be positive", what, stretch));
  const ElasticConstants moduli = small_strain_moduli(spec);
  const double tiny = 1e-13 * (moduli.bulk_modulus + moduli.shear_modulus);
  const int steps = 1 + static_cast<int>(std::abs(std::log(stretch)) / 0.05);
  Vector3 logs = Vector3::Zero(), stress = Vector3::Zero();
  for (int step = 1; step <= steps; ++step) {
    const double now = std::exp(std::log(stretch) * step / steps);
    const Vector3 fixed = given(now);
    for (int i = 0; i < 3; ++i)
      if (!free[i])
        logs[i] = std::log(fixed[i]);
    bool found = false;
    for (int iteration = 0; iteration < 60 && !found; ++iteration) {
      ThreeStresses stretches;
      for (int i = 0; i < 3; ++i)
        stretches[i] = exponential(Three::variable(logs[i], i));
      const ThreeStresses now_stress = principal(spec, stretches);
      Vector3 rest;
      Matrix3 slope = Matrix3::Identity();
      double largest = 0;
      for (int i = 0; i < 3; ++i) {
        stress[i] = now_stress[i].value;
        largest = std::max(largest, std::abs(stress[i]));
        rest[i] = free[i] ? stress[i] : 0;
        for (int k = 0; k < 3 && free[i]; ++k)
          slope(i, k) = free[k] ? now_stress[i].slope[k] : (i == k ? 1 : 0);
      }
      found = rest.lpNorm<Eigen::Infinity>() <= tiny + 1e-13 * largest;
      if (found)
        break;
      Vector3 change = slope.partialPivLu().solve(rest);
      const double size = change.lpNorm<Eigen::Infinity>();
      if (!std::isfinite(size))
        break;
      logs -= change * (size > 0.1 ? 0.1 / size : 1);
    }
    if (!found)
      throw InputError(
          fmt::format("homogeneous state, {}: the law {} has no state at a stretch of {:.4g} that leaves the "
                      "free sides free",
                      what, law_name(spec), now));
  }
  return {diagonal_of(logs.array().exp()), diagonal_of(stress)};
}

} // namespace

Vector3 principal_stress(const LawSpec& spec, const Vector3& stretches) {
  check_fibres(spec);
  if (!(stretches.minCoeff() > 0) || !stretches.allFinite())
    throw InputError(fmt::format("homogeneous state: the stretches are {}, {}, {}; they must be positive", stretches[0],
                                 stretches[1], stretches[2]));
  const ThreeStresses stress = principal(spec, {Three(stretches[0]), Three(stretches[1]), Three(stretches[2])});
  return {stress[0].value, stress[1].value, stress[2].value};
}

State uniaxial(const LawSpec& spec, double stretch) {
  return solve_free(spec, "uniaxial", stretch, {false, true, true}, [](double now) { return Vector3(now, 1, 1); });
}

State confined(const LawSpec& spec, double stretch) {
  return {diagonal_of({stretch, 1, 1}), diagonal_of(principal_stress(spec, {stretch, 1, 1}))};
}

State equibiaxial(const LawSpec& spec, double stretch) {
  return solve_free(spec, "equibiaxial", stretch, {false, false, true},
                    [](double now) { return Vector3(now, now, 1); });
}

State pure_shear(const LawSpec& spec, double stretch) {
  return solve_free(spec, "pure shear", stretch, {false, false, true}, [](double now) { return Vector3(now, 1, 1); });
}

State simple_shear(const LawSpec& spec, double amount) {
  State state;
  state.gradient(0, 1) = amount;
  if (const auto* linear = std::get_if<LinearLaw>(&spec.law)) {
    state.stress(0, 1) = state.stress(1, 0) = linear->shear_modulus * amount;
    return state;
  }
  // Principal stretches l and 1/l with l - 1/l = amount, J = 1; Cauchy stress on the axes of B = F F^T, whose first is
  // at the angle p to e1 with tan p = 1 / l.
  const double stretch = 0.5 * amount + std::sqrt(1 + 0.25 * amount * amount);
  LawSpec ground = spec;
  if (auto* law = std::get_if<HolzapfelLaw>(&ground.law))
    ground.law = NeoHookeanLaw{law->shear_modulus};
  const Vector3 piola = principal_stress(ground, {stretch, 1 / stretch, 1});
  const double angle = std::atan2(1.0, stretch);
  const Vector3 first(std::cos(angle), std::sin(angle), 0), second(-std::sin(angle), std::cos(angle), 0);
  Matrix3 cauchy = piola[0] * stretch * first * first.transpose() + piola[1] / stretch * second * second.transpose();
  cauchy(2, 2) = piola[2];
  Matrix3 back = Matrix3::Identity(); // F^-T
  back(1, 0) = -amount;
  state.stress = cauchy * back;
  if (const auto* law = std::get_if<HolzapfelLaw>(&spec.law))
    for (const Vector3& a : law->directions) {
      const Vector3 along(a[0] + amount * a[1], a[1], a[2]);
      const double e = fibre_strain(*law, along.squaredNorm(), 3 + amount * amount);
      const double pull = 2 * law->fibre_modulus * e * std::exp(law->fibre_exponent * e * e);
      state.stress += pull * (law->dispersion * state.gradient + (1 - 3 * law->dispersion) * along * a.transpose());
    }
  return state;
}

State uniaxial_along(const Law& law, const Vector3& axis, double stretch) {
  if (!(stretch > 0) || !std::isfinite(stretch))
    throw InputError(fmt::format("homogeneous state, uniaxial: the stretch is {}; it must be positive", stretch));
  // In axes of which the first is the given one, F is upper triangular: F11 is given, five entries are free, and the
  // second Piola stress but its first entry vanishes: the same five places.
  const Matrix3 turn = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitX(), axis).toRotationMatrix();
  FibreFrame frame = law.own_fibres();
  for (Vector3& a : frame.direction)
    a = turn.transpose() * a;
  static constexpr int row[5] = {0, 0, 1, 1, 2}, column[5] = {1, 2, 1, 2, 2};
  const double tiny = 1e-12 * (law.small_strain().bulk_modulus + law.small_strain().shear_modulus);
  const int steps = 1 + static_cast<int>(std::abs(std::log(stretch)) / 0.05);
  Matrix3 f = Matrix3::Identity(), stress = Matrix3::Zero();
  double energy = 0;
  for (int step = 1; step <= steps; ++step) {
    f(0, 0) = std::exp(std::log(stretch) * step / steps);
    bool found = false;
    for (int iteration = 0; iteration < 60; ++iteration) {
      law.evaluate({&f, 1}, {&frame, 1}, {&energy, 1}, {&stress, 1});
      const Matrix3 inverse = f.inverse(), second = inverse * stress;
      Eigen::Matrix<double, 5, 1> rest;
      for (int i = 0; i < 5; ++i)
        rest[i] = second(row[i], column[i]);
      found = rest.lpNorm<Eigen::Infinity>() <= tiny + 1e-12 * stress.norm();
      if (found || !rest.allFinite())
        break;
      const Matrix9 tangent = law.tangent(f, frame);
      Eigen::Matrix<double, 5, 5> slope;
      for (int k = 0; k < 5; ++k) {
        Matrix3 change = Matrix3::Zero(); // of S with entry k of F
        for (int i = 0; i < 9; ++i)
          change.data()[i] = tangent(i, row[k] + 3 * column[k]);
        Matrix3 unit = Matrix3::Zero();
        unit(row[k], column[k]) = 1;
        change = inverse * (change - unit * second);
        for (int i = 0; i < 5; ++i)
          slope(i, k) = change(row[i], column[i]);
      }
      const Eigen::Matrix<double, 5, 1> change = slope.partialPivLu().solve(rest);
      const double size = change.lpNorm<Eigen::Infinity>(), share = size > 0.1 ? 0.1 / size : 1;
      for (int k = 0; k < 5; ++k)
        f(row[k], column[k]) -= share * change[k];
    }
    if (!found)
      throw InputError(fmt::format("homogeneous state, uniaxial: the law {} has no state at a stretch of {:.4g} that "
                                   "leaves the lateral sides free",
                                   law.name(), f(0, 0)));
  }
  return {turn * f * turn.transpose(), turn * stress * turn.transpose()};
}

} // namespace spherecut::solvers::homogeneous
