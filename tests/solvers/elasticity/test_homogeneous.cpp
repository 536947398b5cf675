#include "solvers/elasticity/homogeneous.hpp"
#include "solvers/elasticity/law_checks.hpp"
#include "tests/solvers/elasticity/sample_laws.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using homogeneous::State;
using tests::at;

namespace {

constexpr double mu = 3e3;

/// So little compressible that formulas of incompressible bodies hold to 1e-5.
LawSpec incompressible(const LawSpec& spec) {
  LawSpec other = spec;
  other.bulk_modulus = 1e6 * mu;
  return other;
}

/// Two families that mirror each other about the first axis.
HolzapfelLaw mirrored(double angle, double dispersion) {
  HolzapfelLaw law = tests::sample_fibres(dispersion);
  law.directions = {Vector3(std::cos(angle), std::sin(angle), 0), Vector3(std::cos(angle), -std::sin(angle), 0)};
  return law;
}

HolzapfelLaw single(const Vector3& direction) {
  HolzapfelLaw law = tests::sample_fibres(0);
  law.families = 1;
  law.directions = {direction};
  return law;
}

} // namespace

TEST_CASE("States in closed form have the stress that the laws give there") {
  for (const double nu : {0.3, 0.45, 0.499})
    for (LawSpec spec : tests::sample_laws(nu)) {
      if (auto* fibres = std::get_if<HolzapfelLaw>(&spec.law))
        spec.law = mirrored(0.6, fibres->dispersion);
      const bool linear = std::holds_alternative<LinearLaw>(spec.law);
      const std::unique_ptr<Law> law = make_law(spec);
      INFO(law->name() << ", nu = " << nu);
      for (const double stretch : linear ? std::vector<double>{0.8, 1.2} : std::vector<double>{0.5, 0.8, 1.3, 2.0}) {
        INFO("stretch " << stretch);
        for (const State& state : {homogeneous::uniaxial(spec, stretch), homogeneous::confined(spec, stretch),
                                   homogeneous::equibiaxial(spec, stretch), homogeneous::pure_shear(spec, stretch),
                                   homogeneous::simple_shear(spec, stretch - 0.9)})
          CHECK((at(*law, state.gradient).stress - state.stress).norm() <
                1e-11 * (state.stress.norm() + 1e-3 * spec.bulk_modulus));
        const State one = homogeneous::uniaxial(spec, stretch), two = homogeneous::equibiaxial(spec, stretch);
        CHECK(one.gradient(0, 0) == Approx(stretch));
        CHECK(std::abs(one.stress(1, 1)) + std::abs(one.stress(2, 2)) < 1e-9 * spec.bulk_modulus);
        CHECK(two.gradient(1, 1) == Approx(stretch));
        CHECK(std::abs(two.stress(2, 2)) < 1e-9 * spec.bulk_modulus);
      }
    }
}

TEST_CASE("Incompressible limits of textbooks") {
  const LawSpec neo_hookean = incompressible({NeoHookeanLaw{mu}, 0, {}});
  constexpr double c1 = 0.5 * mu, c2 = -0.02 * mu, c3 = 0.1 * mu;
  const LawSpec yeoh = incompressible({YeohLaw{c1, c2, c3}, 0, {}});
  // Mooney and Rivlin's law is Ogden's with the exponents 2 and -2: mu_1 = 2 m1, mu_2 = -2 m2.
  constexpr double m1 = 0.35 * mu, m2 = 0.15 * mu;
  const LawSpec mooney = incompressible({OgdenLaw{{{2 * m1, 2}, {-2 * m2, -2}}}, 0, {}});
  // Rubber of Treloar as Ogden (1972) fits it, here in Pa.
  const OgdenLaw rubber{{{0.63e6, 1.3}, {0.0012e6, 5}, {-0.01e6, -2}}};
  const LawSpec ogden{rubber, 1e6 * 0.4e6, {}};
  const LawSpec fibres = incompressible({single(Vector3::UnitX()), 0, {}});
  for (const double l : {0.5, 0.7, 1.2, 1.6, 2.0}) {
    INFO("stretch " << l);
    const double first = l * l + 2 / l; // I1
    CHECK(homogeneous::uniaxial(neo_hookean, l).stress(0, 0) == Approx(mu * (l - 1 / (l * l))).epsilon(2e-5));
    CHECK(homogeneous::equibiaxial(neo_hookean, l).stress(0, 0) == Approx(mu * (l - std::pow(l, -5))).epsilon(5e-5));
    CHECK(homogeneous::pure_shear(neo_hookean, l).stress(0, 0) == Approx(mu * (l - std::pow(l, -3))).epsilon(2e-5));
    CHECK(homogeneous::uniaxial(yeoh, l).stress(0, 0) ==
          Approx(2 * (l - 1 / (l * l)) * (c1 + 2 * c2 * (first - 3) + 3 * c3 * std::pow(first - 3, 2))).epsilon(5e-5));
    CHECK(homogeneous::uniaxial(mooney, l).stress(0, 0) == Approx(2 * (m1 + m2 / l) * (l - 1 / (l * l))).epsilon(5e-5));
    double uniaxial = 0, equibiaxial = 0;
    for (const OgdenLaw::Term& term : rubber.terms) {
      uniaxial += term.modulus * (std::pow(l, term.exponent - 1) - std::pow(l, -0.5 * term.exponent - 1));
      equibiaxial += term.modulus * (std::pow(l, term.exponent - 1) - std::pow(l, -2 * term.exponent - 1));
    }
    CHECK(homogeneous::uniaxial(ogden, l).stress(0, 0) == Approx(uniaxial).epsilon(5e-5));
    CHECK(homogeneous::equibiaxial(ogden, l).stress(0, 0) == Approx(equibiaxial).epsilon(1e-4));
    const double e = std::max(l * l - 1, 0.0);
    CHECK(homogeneous::uniaxial(fibres, l).stress(0, 0) ==
          Approx(mu * (l - 1 / (l * l)) + 2 * 2.4e3 * e * std::exp(0.84 * e * e) * l).epsilon(5e-5));
  }
}

TEST_CASE("Simple shear has the shear stress and the normal stresses of Rivlin, at any bulk modulus") {
  for (const double nu : {0.3, 0.499})
    for (const double amount : {0.2, 1.0, -1.5}) {
      const double bulk = bulk_modulus_of(mu, nu), square = amount * amount;
      const LawSpec neo_hookean{NeoHookeanLaw{mu}, bulk, {}};
      const State state = homogeneous::simple_shear(neo_hookean, amount);
      const Matrix3 cauchy = state.stress * state.gradient.transpose();
      CHECK(cauchy(0, 1) == Approx(mu * amount));
      CHECK(cauchy(0, 0) - cauchy(1, 1) == Approx(mu * square));
      CHECK(cauchy(0, 0) == Approx(2.0 / 3 * mu * square)); // the mean vanishes: J = 1
      // A fibre across the shear: sigma_12 = 2 k1 E exp(k2 E^2) amount with E = amount^2.
      const LawSpec fibres{single(Vector3::UnitY()), bulk, {}};
      const double pull = 2 * 2.4e3 * square * std::exp(0.84 * square * square);
      const State stiffer = homogeneous::simple_shear(fibres, amount);
      CHECK((stiffer.stress * stiffer.gradient.transpose())(0, 1) == Approx((mu + pull) * amount));
    }
}

TEST_CASE("Uniaxial stress along any direction, with fibres askew") {
  const Vector3 axis = Vector3(1, -2, 0.5).normalized();
  for (const LawSpec& spec : tests::sample_laws(0.45)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    for (const double stretch : {0.8, 1.25}) {
      const State state = homogeneous::uniaxial_along(*law, axis, stretch);
      CHECK((state.gradient * axis - stretch * axis).norm() < 1e-12);
      // Nothing pulls at lateral sides, and what pulls along the axis does so straight.
      const Matrix3 rest = state.stress - axis.dot(state.stress * axis) * axis * axis.transpose();
      CHECK(rest.norm() < 1e-8 * spec.bulk_modulus);
      if (!std::holds_alternative<HolzapfelLaw>(spec.law))
        CHECK(axis.dot(state.stress * axis) == Approx(homogeneous::uniaxial(spec, stretch).stress(0, 0)).epsilon(1e-9));
    }
  }
  // Along the fibre it is the state in closed form; at 45 degrees softer than that, stiffer than across.
  const double bulk = bulk_modulus_of(mu, 0.45);
  const auto pull = [&](const Vector3& fibre) {
    return homogeneous::uniaxial_along(*make_law({single(fibre), bulk, {}}), Vector3::UnitX(), 1.3).stress(0, 0);
  };
  const double along = pull(Vector3::UnitX()), askew = pull(Vector3(1, 1, 0).normalized()),
               across = pull(Vector3::UnitY());
  CHECK(along == Approx(homogeneous::uniaxial({single(Vector3::UnitX()), bulk, {}}, 1.3).stress(0, 0)));
  CHECK(across == Approx(homogeneous::uniaxial({single(Vector3::UnitY()), bulk, {}}, 1.3).stress(0, 0)));
  CHECK(across == Approx(homogeneous::uniaxial({NeoHookeanLaw{mu}, bulk, {}}, 1.3).stress(0, 0)));
  CHECK(askew < along);
  CHECK(askew > 1.001 * across);
}

TEST_CASE("What has no homogeneous state is refused") {
  const LawSpec spec{NeoHookeanLaw{mu}, bulk_modulus_of(mu, 0.4), {}};
  for (const double stretch : {0.0, -1.0, std::nan("")}) {
    CHECK_THROWS_AS(homogeneous::uniaxial(spec, stretch), InputError);
    CHECK_THROWS_AS(homogeneous::confined(spec, stretch), InputError);
    CHECK_THROWS_AS(homogeneous::uniaxial_along(*make_law(spec), Vector3::UnitX(), stretch), InputError);
  }
  const LawSpec askew{single(Vector3(1, 1, 0).normalized()), bulk_modulus_of(mu, 0.4), {}};
  CHECK_THROWS_WITH(homogeneous::uniaxial(askew, 1.1), Catch::Contains("askew"));
  // Hooke's law, pulled in two directions, has no thickness left.
  const LawSpec linear{LinearLaw{mu}, bulk_modulus_of(mu, 0.45), {}};
  CHECK_THROWS_WITH(homogeneous::equibiaxial(linear, 2), Catch::Contains("no state at a stretch of"));
}
