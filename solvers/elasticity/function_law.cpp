#include "solvers/elasticity/function_law.hpp"

#include "solvers/elasticity/law_checks.hpp"

#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {
namespace {

constexpr double difference_step = 1e-3;
constexpr double same = 1e-4;           // of the larger: what two ways to a derivative may differ by
constexpr double stress_at_rest = 1e-6; // of mu
constexpr std::array<double, 4> stencil_place{1, -1, 2, -2};
constexpr std::array<double, 4> stencil_weight{8, -8, -1, 1}; // over 12 steps
constexpr std::size_t stencil = 36;                           // four places for each of nine numbers

std::string text_of(const Matrix3& f) {
  return fmt::format("[[{:.6g}, {:.6g}, {:.6g}], [{:.6g}, {:.6g}, {:.6g}], [{:.6g}, {:.6g}, {:.6g}]]", f(0, 0), f(0, 1),
                     f(0, 2), f(1, 0), f(1, 1), f(1, 2), f(2, 0), f(2, 1), f(2, 2));
}

/// F of every point moved to the places of the stencil, point after point.
std::vector<Matrix3> moved(std::span<const Matrix3> gradients) {
  std::vector<Matrix3> all;
  all.reserve(stencil * gradients.size());
  for (const Matrix3& f : gradients)
    for (int k = 0; k < 9; ++k)
      for (const double place : stencil_place) {
        all.push_back(f);
        all.back().data()[k] += place * difference_step;
      }
  return all;
}

/// The slope by number k of F from the values of one point's stencil.
template <class Value>
Value slope_of(const Value* values, int k) {
  const Value* v = values + 4 * static_cast<std::ptrdiff_t>(k);
  Value sum = stencil_weight[0] * v[0];
  for (std::size_t i = 1; i < stencil_weight.size(); ++i)
    sum += stencil_weight[i] * v[i];
  return sum / (12 * difference_step);
}

class FunctionLaw final : public Law {
 public:
  explicit FunctionLaw(LawFunctions functions)
      : functions_(std::move(functions)), volume_(make_law_unchecked({NeoHookeanLaw{0}, functions_.bulk_modulus, {}})) {
  }

  /// What is at rest, once the functions are known to be sound there.
  void begin() {
    const Matrix3 rest = Matrix3::Identity();
    rest_ = slope(rest);
    const Matrix9 all = rest_ + volume_->tangent(rest, {});
    double volumetric = 0, trace = 0; // C_iijj = 9 kappa, C_ijij = 3 kappa + 10 mu where it is isotropic
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        volumetric += all(4 * i, 4 * j);
        trace += 0.5 * (all(i + 3 * j, i + 3 * j) + all(i + 3 * j, j + 3 * i));
      }
    moduli_ = {(trace - volumetric / 3) / 10, volumetric / 9};
  }

  void evaluate(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
                std::span<Matrix3> stress) const override {
    evaluate_isochoric(gradients, fibres, energy, stress);
    if (!(functions_.bulk_modulus > 0))
      return;
    std::vector<double> more(gradients.size());
    std::vector<Matrix3> pressure(gradients.size());
    volume_->evaluate(gradients, {}, more, pressure);
    for (std::size_t k = 0; k < gradients.size(); ++k) {
      energy[k] += more[k];
      stress[k] += pressure[k];
    }
  }

  void evaluate_isochoric(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                          std::span<double> energy, std::span<Matrix3> stress) const override {
    const std::size_t count = gradients.size();
    if (energy.size() != count || stress.size() != count)
      throw InputError(fmt::format("law {}: {} gradients, {} energies, {} stresses; lengths must agree", name(), count,
                                   energy.size(), stress.size()));
    if (!fibres.empty())
      throw InputError(fmt::format("law {}: {} fibre frames; allowed: none, functions of F alone", name(), count));
    std::fill(energy.begin(), energy.end(), std::numeric_limits<double>::infinity());
    std::fill(stress.begin(), stress.end(), Matrix3::Zero());
    std::vector<std::size_t> places; // of what the functions are asked for
    std::vector<Matrix3> asked;
    const auto ask = [&](std::size_t k) {
      places.push_back(k);
      asked.push_back(gradients[k]);
    };
    for (std::size_t k = 0; k < count; ++k)
      if (gradients[k].determinant() > 0)
        ask(k);
    std::vector<double> values = energies(asked, places);
    std::vector<std::size_t> all = std::move(places);
    places.clear();
    asked.clear();
    for (std::size_t k = 0; k < all.size(); ++k)
      if (std::isfinite(values[k])) {
        energy[all[k]] = values[k];
        ask(all[k]);
      }
    const std::vector<Matrix3> stresses = stresses_of(asked, places);
    for (std::size_t k = 0; k < places.size(); ++k) {
      stress[places[k]] = stresses[k];
      if (!stresses[k].allFinite()) // differences that reach where the law cannot be asked
        energy[places[k]] = std::numeric_limits<double>::infinity(), stress[places[k]].setZero();
    }
  }

  [[nodiscard]] Matrix9 tangent(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return tangent_isochoric(gradient, fibre) + volume_->tangent(gradient, {});
  }
  [[nodiscard]] Matrix9 tangent_isochoric(const Matrix3& gradient, const FibreFrame&) const override {
    if (gradient == Matrix3::Identity())
      return rest_;
    return gradient.determinant() > 0 ? slope(gradient) : Matrix9::Zero().eval();
  }
  [[nodiscard]] FibreFrame own_fibres() const override { return {}; }
  [[nodiscard]] bool small_strain_only() const override { return false; }
  [[nodiscard]] double volumetric_energy(double j) const override { return volume_->volumetric_energy(j); }
  [[nodiscard]] double pressure(double j) const override { return volume_->pressure(j); }
  [[nodiscard]] double bulk_slope(double j) const override { return volume_->bulk_slope(j); }
  [[nodiscard]] ElasticConstants small_strain() const override { return moduli_; }
  [[nodiscard]] std::string name() const override { return functions_.name; }

  /// P by differences of the energy, and dP/dF by differences of P, at one point.
  [[nodiscard]] Matrix3 slope_of_energy(const Matrix3& f) const { return differences_of_energy({&f, 1}, {}).front(); }
  [[nodiscard]] Matrix9 slope_of_stress(const Matrix3& f) const {
    const std::vector<Matrix3> around = moved({&f, 1});
    const std::vector<Matrix3> stresses = stresses_of(around, std::vector<std::size_t>(around.size(), 0));
    Matrix9 tangent;
    for (int k = 0; k < 9; ++k) {
      const Matrix3 change = slope_of(stresses.data(), k);
      tangent.col(k) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(change.data());
    }
    return tangent;
  }

 private:
  [[noreturn]] void refuse(const char* function, const std::string& value, const Matrix3& f, std::size_t point) const {
    throw LawValueError(
        fmt::format("law {}: {} is {} at F = {}; allowed: finite numbers", name(), function, value, text_of(f)), point);
  }

  /// W of gradients whose numbers among those that the law was asked for are `places`.
  [[nodiscard]] std::vector<double> energies(std::span<const Matrix3> gradients,
                                             std::span<const std::size_t> places) const {
    std::vector<double> values(gradients.size());
    if (!gradients.empty())
      functions_.energy(gradients, values);
    for (std::size_t k = 0; k < values.size(); ++k)
      if (!std::isfinite(values[k]) && !(values[k] > 0))
        refuse("energy", fmt::format("{}", values[k]), gradients[k], places.empty() ? 0 : places[k]);
    return values;
  }

  [[nodiscard]] std::vector<Matrix3> differences_of_energy(std::span<const Matrix3> gradients,
                                                           std::span<const std::size_t> places) const {
    const std::vector<Matrix3> around = moved(gradients);
    std::vector<double> values(around.size(), std::numeric_limits<double>::infinity());
    std::vector<Matrix3> asked;
    std::vector<std::size_t> slots, numbers;
    for (std::size_t k = 0; k < around.size(); ++k)
      if (around[k].determinant() > 0) {
        asked.push_back(around[k]);
        slots.push_back(k);
        numbers.push_back(places.empty() ? 0 : places[k / stencil]);
      }
    const std::vector<double> found = energies(asked, numbers);
    for (std::size_t k = 0; k < slots.size(); ++k)
      values[slots[k]] = found[k];
    std::vector<Matrix3> stresses(gradients.size());
    for (std::size_t p = 0; p < stresses.size(); ++p)
      for (int k = 0; k < 9; ++k)
        stresses[p].data()[k] = slope_of(values.data() + stencil * p, k);
    return stresses;
  }

  /// Not finite only where differences reach states that the law cannot be asked for.
  [[nodiscard]] std::vector<Matrix3> stresses_of(std::span<const Matrix3> gradients,
                                                 std::span<const std::size_t> places) const {
    if (!functions_.stress)
      return differences_of_energy(gradients, places);
    std::vector<Matrix3> stresses(gradients.size(), Matrix3::Zero());
    if (!gradients.empty())
      functions_.stress(gradients, stresses);
    for (std::size_t k = 0; k < stresses.size(); ++k)
      if (!stresses[k].allFinite())
        refuse("stress", text_of(stresses[k]), gradients[k], places[k]);
    return stresses;
  }

  [[nodiscard]] Matrix9 slope(const Matrix3& f) const {
    if (!functions_.tangent)
      return slope_of_stress(f);
    Matrix9 tangent = Matrix9::Zero();
    functions_.tangent({&f, 1}, {&tangent, 1});
    if (!tangent.allFinite())
      refuse("tangent", "not finite", f, 0);
    return tangent;
  }

  LawFunctions functions_;
  std::unique_ptr<Law> volume_; // U(J) alone
  Matrix9 rest_ = Matrix9::Zero();
  ElasticConstants moduli_;
};

/// Strained states that have nothing in common with axes, det F > 0.
std::vector<Matrix3> strained_states() {
  std::vector<Matrix3> states;
  for (int n = 0; n < 6; ++n) {
    Matrix3 f = Matrix3::Identity();
    for (int k = 0; k < 9; ++k)
      f.data()[k] += 0.08 * std::sin(1.0 + 2.3 * n + 1.7 * k + 0.31 * n * k);
    states.push_back(f);
  }
  return states;
}

void require_sound(const FunctionLaw& law, const LawFunctions& functions) {
  const ElasticConstants moduli = law.small_strain();
  if (!(moduli.shear_modulus > 0 && moduli.bulk_modulus > same * moduli.shear_modulus))
    throw InputError(fmt::format("law {}: at rest the shear modulus is {:.6g} Pa and the bulk modulus {:.6g} Pa; "
                                 "allowed: both above 0, the latter above 1e-4 of the former",
                                 law.name(), moduli.shear_modulus, moduli.bulk_modulus));
  const auto state = [&](const Matrix3& f) {
    double energy = 0;
    Matrix3 stress;
    law.evaluate_isochoric({&f, 1}, {}, {&energy, 1}, {&stress, 1});
    if (!std::isfinite(energy))
      throw InputError(
          fmt::format("law {}: energy is {} at F = {}; allowed: finite there", law.name(), energy, text_of(f)));
    return stress;
  };
  const double at_rest = state(Matrix3::Identity()).norm();
  if (at_rest > stress_at_rest * moduli.shear_modulus)
    throw InputError(fmt::format("law {}: stress is {:.3g} Pa at F = 1; allowed: at most {:.3g} Pa, nothing acts at "
                                 "rest",
                                 law.name(), at_rest, stress_at_rest * moduli.shear_modulus));
  for (const Matrix3& f : strained_states()) {
    const Matrix3 stress = state(f);
    const double limit = same * std::max(stress.norm(), moduli.shear_modulus);
    if (functions.stress) {
      const double apart = (law.slope_of_energy(f) - stress).norm();
      if (!(apart <= limit))
        throw InputError(fmt::format("law {}: stress is {:.3g} Pa from the slope of the energy at F = {}; allowed: at "
                                     "most {:.3g} Pa",
                                     law.name(), apart, text_of(f), limit));
    }
    if (functions.tangent) {
      const Matrix9 tangent = law.tangent_isochoric(f, {});
      const double apart = (law.slope_of_stress(f) - tangent).norm(), most = same * tangent.norm();
      if (!(apart <= most))
        throw InputError(fmt::format("law {}: tangent is {:.3g} Pa from the slope of the stress at F = {}; allowed: at "
                                     "most {:.3g} Pa",
                                     law.name(), apart, text_of(f), most));
    }
  }
}

} // namespace

void throw_with_place(const LawValueError& error, const Vector3& x) {
  throw InputError(
      fmt::format("{} (at {:.6g}, {:.6g}, {:.6g} m of the body at rest)", error.what(), x.x(), x.y(), x.z()));
}

std::unique_ptr<Law> make_function_law(LawFunctions functions) {
  if (!functions.energy)
    throw InputError(fmt::format("law {}: no energy; stress and tangent may be left out, energy not", functions.name));
  if (!(functions.bulk_modulus >= 0 && std::isfinite(functions.bulk_modulus)))
    throw InputError(
        fmt::format("law {}: bulk modulus {} Pa; allowed: 0, or above it", functions.name, functions.bulk_modulus));
  const LawFunctions given = functions;
  auto law = std::make_unique<FunctionLaw>(std::move(functions));
  law->begin();
  require_sound(*law, given);
  return law;
}

} // namespace spherecut::solvers
