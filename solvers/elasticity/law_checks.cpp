#include "solvers/elasticity/law_checks.hpp"

#include "solvers/elasticity/homogeneous.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>
#include <numbers>
#include <optional>

namespace spherecut::solvers {
namespace {

constexpr double reach_of_check = 2;      // stretch
constexpr double largest_poisson = 0.499; // beyond it the conditioning of K has no digits to spare
constexpr int most_terms = 3;

[[noreturn]] void refuse(const LawSpec& spec, const std::string& what) {
  throw InputError(fmt::format("law {}: {}", law_name(spec), what));
}

void check_positive(const LawSpec& spec, const char* constant, double value, const char* unit) {
  if (!(value > 0) || !std::isfinite(value))
    refuse(spec, fmt::format("{} is {}{}; it must be positive and finite", constant, value, unit));
}

void check_finite(const LawSpec& spec, const std::string& constant, double value, const char* unit) {
  if (!std::isfinite(value))
    refuse(spec, fmt::format("{} is {}{}; it must be finite", constant, value, unit));
}

void check_constants(const LawSpec& spec, const LinearLaw& law) {
  check_positive(spec, "shear_modulus", law.shear_modulus, " Pa");
}

void check_constants(const LawSpec& spec, const NeoHookeanLaw& law) {
  check_positive(spec, "shear_modulus", law.shear_modulus, " Pa");
}

void check_constants(const LawSpec& spec, const YeohLaw& law) {
  check_positive(spec, "c1", law.c1, " Pa");
  check_finite(spec, "c2", law.c2, " Pa");
  check_finite(spec, "c3", law.c3, " Pa");
}

void check_constants(const LawSpec& spec, const OgdenLaw& law) {
  if (law.terms.empty() || law.terms.size() > most_terms)
    refuse(spec, fmt::format("it has {} terms; one to {} are possible", law.terms.size(), most_terms));
  double sum = 0;
  for (std::size_t p = 0; p < law.terms.size(); ++p) {
    const OgdenLaw::Term& term = law.terms[p];
    check_finite(spec, fmt::format("the modulus of term {}", p + 1), term.modulus, " Pa");
    if (!std::isfinite(term.exponent) || term.exponent == 0 || std::abs(term.exponent) > 50)
      refuse(spec,
             fmt::format("the exponent of term {} is {}; it must lie in [-50, 50] and not be 0", p + 1, term.exponent));
    sum += term.modulus * term.exponent;
  }
  if (!(sum > 0))
    refuse(spec,
           fmt::format("the products of modulus and exponent add to {} Pa, twice the shear modulus; the sum must be "
                       "positive",
                       sum));
}

void check_constants(const LawSpec& spec, const HolzapfelLaw& law) {
  check_positive(spec, "shear_modulus", law.shear_modulus, " Pa");
  check_positive(spec, "fibre_modulus", law.fibre_modulus, " Pa");
  check_positive(spec, "fibre_exponent", law.fibre_exponent, "");
  if (!(law.dispersion >= 0 && law.dispersion <= 1.0 / 3))
    refuse(spec, fmt::format("dispersion is {}; it must lie in [0, 1/3]", law.dispersion));
  if (law.families != 1 && law.families != 2)
    refuse(spec, fmt::format("it has {} fibre families; one or two are possible", law.families));
  if (!law.same_everywhere)
    return;
  if (law.directions.size() != static_cast<std::size_t>(law.families))
    refuse(spec, fmt::format("{} fibre families have {} directions; every family needs one", law.families,
                             law.directions.size()));
  for (const Vector3& a : law.directions)
    if (!(std::abs(a.norm() - 1) < 1e-9))
      refuse(spec, fmt::format("the fibre direction ({}, {}, {}) has length {}; it must be a unit vector", a[0], a[1],
                               a[2], a.norm()));
}

void check_bulk(const LawSpec& spec) {
  const ElasticConstants moduli = small_strain_moduli(spec);
  if (!(moduli.bulk_modulus > 0) || !std::isfinite(moduli.bulk_modulus))
    refuse(spec,
           fmt::format("the bulk modulus is {} Pa; it must be positive and finite: Poisson's ratio must lie in [0, "
                       "{}]",
                       moduli.bulk_modulus, largest_poisson));
  const double nu = moduli.poisson_ratio();
  const bool linear = std::holds_alternative<LinearLaw>(spec.law);
  if (!(nu >= -1e-9) || !(linear ? nu < 0.5 : nu <= largest_poisson + 1e-9))
    refuse(spec,
           fmt::format("Poisson's ratio is {:.6g} (shear modulus {:.6g} Pa, bulk modulus {:.6g} Pa); it must lie in "
                       "[0, {}",
                       nu, moduli.shear_modulus, moduli.bulk_modulus, linear ? "0.5)" : "0.499]"));
}

/// Directions over a half sphere: rings of equal width.
const std::vector<Vector3>& half_sphere() {
  static const std::vector<Vector3> directions = [] {
    std::vector<Vector3> made{Vector3::UnitZ()};
    constexpr int rings = 12;
    for (int ring = 1; ring <= rings; ++ring) {
      const double polar = 0.5 * std::numbers::pi * ring / rings;
      const int count = static_cast<int>(std::lround(2 * rings * std::sin(polar)));
      const int used = ring == rings ? count / 2 : count;
      for (int k = 0; k < used; ++k) {
        const double turn = 2 * std::numbers::pi * k / count;
        made.emplace_back(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar));
      }
    }
    return made;
  }();
  return directions;
}

/// Acoustic tensors positive definite in all directions, to the rounding of their largest entries. Leading minors say
/// so of nearly all, eigenvalues of the others.
bool elliptic(const Matrix9& tangent) {
  constexpr double rounding = 1e-11;
  for (const Vector3& n : half_sphere()) {
    Matrix3 q = Matrix3::Zero();
    for (int l = 0; l < 3; ++l)
      for (int j = 0; j < 3; ++j)
        q += n[j] * n[l] * tangent.block<3, 3>(3 * j, 3 * l);
    if (q(0, 0) > 0 && q(0, 0) * q(1, 1) - q(0, 1) * q(1, 0) > 0 && q.determinant() > 0)
      continue;
    if (!q.allFinite())
      return false;
    const Vector3 values = Eigen::SelfAdjointEigenSolver<Matrix3>(q, Eigen::EigenvaluesOnly).eigenvalues();
    if (!(values[0] > -rounding * values[2]))
      return false;
  }
  return true;
}

enum class Path { uniaxial, equibiaxial, pure_shear, confined, all_around };
constexpr std::array<Path, 5> paths{Path::uniaxial, Path::equibiaxial, Path::pure_shear, Path::confined,
                                    Path::all_around};

std::string path_name(Path path, bool pulled) {
  switch (path) {
  case Path::uniaxial:
    return pulled ? "uniaxial tension" : "uniaxial compression";
  case Path::equibiaxial:
    return pulled ? "equibiaxial tension" : "equibiaxial compression";
  case Path::pure_shear:
    return pulled ? "pure shear, pulled" : "pure shear, pressed";
  case Path::confined:
    return pulled ? "confined tension" : "confined compression";
  default:
    return pulled ? "tension from all sides" : "pressure from all sides";
  }
}

/// F along a path. Throws InputError where the law has no such state.
Matrix3 strained(const LawSpec& spec, Path path, double stretch) {
  const bool fibres = std::holds_alternative<HolzapfelLaw>(spec.law);
  const double across = 1 / stretch;
  Vector3 f(stretch, stretch, stretch); // all around
  switch (path) {
  case Path::uniaxial:
    if (!fibres)
      return homogeneous::uniaxial(spec, stretch).gradient;
    f = {stretch, std::sqrt(across), std::sqrt(across)};
    break;
  case Path::equibiaxial:
    if (!fibres)
      return homogeneous::equibiaxial(spec, stretch).gradient;
    f = {stretch, stretch, across * across};
    break;
  case Path::pure_shear:
    if (!fibres)
      return homogeneous::pure_shear(spec, stretch).gradient;
    f = {stretch, 1, across};
    break;
  case Path::confined:
    f = {stretch, 1, 1};
    break;
  default:
    break;
  }
  return f.asDiagonal();
}

/// The law as it is strained along axes: fibres where each point has its own lie along the first, and the second.
FibreFrame frame_of_check(const LawSpec& spec) {
  FibreFrame frame = law_fibres(spec);
  if (const auto* law = std::get_if<HolzapfelLaw>(&spec.law); law && !law->same_everywhere)
    frame.direction = {Vector3::UnitX(), Vector3::UnitY()};
  return frame;
}

struct ConstantAtFault {
  std::string name;
  double* value;
};

/// What takes the ellipticity of a law away; nothing of those that are polyconvex for all constants that get here.
struct AtFault {
  using Found = std::optional<ConstantAtFault>;
  Found operator()(LinearLaw& /*law*/) const { return std::nullopt; }
  Found operator()(NeoHookeanLaw& /*law*/) const { return std::nullopt; }
  Found operator()(YeohLaw& law) const {
    return law.c2 < 0 ? ConstantAtFault{"c2", &law.c2} : ConstantAtFault{"c3", &law.c3};
  }
  /// Of the terms the one that takes most from the shear modulus, else that of the least exponent.
  Found operator()(OgdenLaw& law) const {
    std::vector<OgdenLaw::Term>& terms = law.terms;
    std::size_t worst = 0;
    for (std::size_t p = 1; p < terms.size(); ++p) {
      const double here = terms[p].modulus * terms[p].exponent, there = terms[worst].modulus * terms[worst].exponent;
      if (std::min(here, there) < 0 ? here < there : std::abs(terms[p].exponent) < std::abs(terms[worst].exponent))
        worst = p;
    }
    return ConstantAtFault{fmt::format("the modulus of term {}", worst + 1), &terms[worst].modulus};
  }
  Found operator()(HolzapfelLaw& /*law*/) const { return std::nullopt; }
};

void check_ellipticity(const LawSpec& spec) {
  LawSpec tried = spec;
  const AtFault::Found at_fault = std::visit(AtFault{}, tried.law);
  if (!at_fault)
    return;
  const std::optional<EllipticityLoss> loss = find_loss(spec, reach_of_check);
  if (!loss)
    return;
  double& constant = *at_fault->value;
  const double given = constant;
  std::string limit;
  constant = 0;
  const bool without = small_strain_moduli(tried).shear_modulus > 0 && !find_loss(tried, reach_of_check);
  if (without) { // between the given value and 0
    double good = 0, bad = given;
    for (int k = 0; k < 12; ++k) {
      constant = 0.5 * (good + bad);
      (small_strain_moduli(tried).shear_modulus > 0 && !find_loss(tried, reach_of_check) ? good : bad) = constant;
    }
    limit = fmt::format("; with the other constants it holds {} {:.4g} Pa", given < 0 ? "from" : "up to", good);
  }
  refuse(spec,
         fmt::format("{} is {} Pa: strong ellipticity is lost in {} at a strain of {:.3g} %; it must hold between "
                     "stretches of {} and {}{}",
                     at_fault->name, given, loss->path, 100 * loss->strain, 1 / reach_of_check, reach_of_check, limit));
}

} // namespace

LawConstants law_constants(const LawSpec& spec) {
  struct Flat {
    LawConstants operator()(const LinearLaw& law) const { return {{law.shear_modulus}}; }
    LawConstants operator()(const NeoHookeanLaw& law) const { return {{law.shear_modulus}}; }
    LawConstants operator()(const YeohLaw& law) const { return {{law.c1, law.c2, law.c3}}; }
    LawConstants operator()(const OgdenLaw& law) const {
      LawConstants flat;
      for (std::size_t p = 0; p < law.terms.size() && p < most_terms; ++p) {
        flat.values[2 * p] = law.terms[p].modulus;
        flat.values[2 * p + 1] = law.terms[p].exponent;
      }
      return flat;
    }
    LawConstants operator()(const HolzapfelLaw& law) const {
      return {{law.shear_modulus, law.fibre_modulus, law.fibre_exponent, law.dispersion,
               static_cast<double>(law.families)}};
    }
  };
  return std::visit(Flat{}, spec.law);
}

ElasticConstants small_strain_moduli(const LawSpec& spec) {
  struct Shear {
    double operator()(const LinearLaw& law) const { return law.shear_modulus; }
    double operator()(const NeoHookeanLaw& law) const { return law.shear_modulus; }
    double operator()(const YeohLaw& law) const { return 2 * law.c1; }
    double operator()(const OgdenLaw& law) const {
      double sum = 0;
      for (const OgdenLaw::Term& term : law.terms)
        sum += term.modulus * term.exponent;
      return 0.5 * sum;
    }
    double operator()(const HolzapfelLaw& law) const { return law.shear_modulus; }
  };
  return {std::visit(Shear{}, spec.law), spec.bulk_modulus};
}

double fibre_stiffness(const HolzapfelLaw& law) {
  const double aligned = 1 - 3 * law.dispersion;
  return 4 * law.fibre_modulus * aligned * aligned;
}

FibreFrame law_fibres(const LawSpec& spec) {
  FibreFrame frame;
  if (const auto* law = std::get_if<HolzapfelLaw>(&spec.law); law && law->same_everywhere)
    for (std::size_t family = 0; family < law->directions.size() && family < 2; ++family)
      frame.direction[family] = law->directions[family];
  return frame;
}

void check_prony_terms(std::span<const PronyTerm> terms) {
  if (terms.size() > most_terms)
    throw InputError(fmt::format("Prony series: it has {} terms; up to {} are possible", terms.size(), most_terms));
  double sum = 0;
  for (std::size_t p = 0; p < terms.size(); ++p) {
    if (!(terms[p].share > 0 && terms[p].share < 1))
      throw InputError(
          fmt::format("Prony series: the share of term {} is {}; it must lie between 0 and 1", p + 1, terms[p].share));
    if (!(terms[p].time > 0) || !std::isfinite(terms[p].time))
      throw InputError(fmt::format("Prony series: the time of term {} is {} s; it must be positive and finite", p + 1,
                                   terms[p].time));
    sum += terms[p].share;
  }
  if (!(sum < 1 - 1e-9))
    throw InputError(
        fmt::format("Prony series: the shares add to {}; the sum must be below 1, for nothing would bear a "
                    "load that stays",
                    sum));
}

void check_law(const LawSpec& spec) {
  std::visit([&](const auto& law) { check_constants(spec, law); }, spec.law);
  check_bulk(spec);
  check_prony_terms(spec.prony);
  check_ellipticity(spec);
}

std::optional<EllipticityLoss> find_loss(const LawSpec& spec, double reach) {
  const std::unique_ptr<Law> law = make_law_unchecked(spec);
  const FibreFrame frame = frame_of_check(spec);
  std::optional<EllipticityLoss> found;
  const int steps = static_cast<int>(std::ceil(std::log(reach) / std::log(1.02)));
  for (const Path path : paths)
    for (const bool pulled : {true, false})
      for (int step = 0; step <= steps; ++step) {
        // So far that no stretch of an incompressible body leaves [1 / reach, reach].
        const double share = path == Path::all_around || path == Path::equibiaxial ? 0.5 : 1;
        const double stretch = std::exp((pulled ? share : -share) * std::log(reach) * step / steps);
        const double strain = stretch - 1;
        if (found && std::abs(found->strain) <= std::abs(strain))
          break;
        bool good = false;
        try {
          good = elliptic(law->tangent(strained(spec, path, stretch), frame));
        } catch (const InputError&) {
          good = false; // the law softens and has no such state
        }
        if (!good) {
          found = {path_name(path, pulled), strain};
          break;
        }
      }
  return found;
}

} // namespace spherecut::solvers
