#include "solvers/elasticity/law_checks.hpp"
#include "tests/solvers/elasticity/sample_laws.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using Catch::Contains;

namespace {

constexpr double mu = 3e3;
const double bulk = bulk_modulus_of(mu, 0.45);
const double infinite = std::numeric_limits<double>::infinity();

/// Changes one constant of the sample of fibres.
LawSpec fibres_with(const std::function<void(HolzapfelLaw&)>& change) {
  HolzapfelLaw law = tests::sample_fibres(0.1);
  change(law);
  return {law, bulk, {}};
}

} // namespace

TEST_CASE("Constants that mean no material are refused with name, value and limit") {
  const std::vector<std::pair<LawSpec, std::vector<std::string>>> refused{
      {{LinearLaw{-1}, bulk, {}}, {"law linear", "shear_modulus is -1 Pa", "positive"}},
      {{NeoHookeanLaw{0}, bulk, {}}, {"law neo_hookean", "shear_modulus is 0 Pa", "positive"}},
      {{NeoHookeanLaw{infinite}, bulk, {}}, {"shear_modulus is inf Pa", "finite"}},
      {{NeoHookeanLaw{mu}, infinite, {}}, {"bulk modulus is inf Pa", "Poisson's ratio must lie in [0, 0.499]"}},
      {{NeoHookeanLaw{mu}, -bulk, {}}, {"bulk modulus is", "positive"}},
      {{NeoHookeanLaw{mu}, bulk_modulus_of(mu, 0.4995), {}}, {"Poisson's ratio is 0.4995", "[0, 0.499]"}},
      {{NeoHookeanLaw{mu}, bulk_modulus_of(mu, -0.1), {}}, {"Poisson's ratio is -0.1", "[0, 0.499]"}},
      {{YeohLaw{-1, 0, 0}, bulk, {}}, {"law yeoh", "c1 is -1 Pa", "positive"}},
      {{YeohLaw{1, infinite, 0}, bulk, {}}, {"c2 is inf Pa", "finite"}},
      {{OgdenLaw{}, bulk, {}}, {"law ogden", "0 terms", "one to 3"}},
      {{OgdenLaw{{{1, 2}, {1, 2}, {1, 2}, {1, 2}}}, bulk, {}}, {"4 terms", "one to 3"}},
      {{OgdenLaw{{{1, 0}}}, bulk, {}}, {"exponent of term 1 is 0", "not be 0"}},
      {{OgdenLaw{{{1, 2}, {1, 60}}}, bulk, {}}, {"exponent of term 2 is 60", "[-50, 50]"}},
      {{OgdenLaw{{{1e3, 2}, {1e3, -2}}}, bulk, {}}, {"add to 0 Pa", "positive"}},
      {fibres_with([](HolzapfelLaw& law) { law.fibre_modulus = 0; }), {"fibre_modulus is 0 Pa", "positive"}},
      {fibres_with([](HolzapfelLaw& law) { law.fibre_exponent = -2; }), {"fibre_exponent is -2;", "positive"}},
      {fibres_with([](HolzapfelLaw& law) { law.dispersion = 0.34; }), {"dispersion is 0.34", "[0, 1/3]"}},
      {fibres_with([](HolzapfelLaw& law) { law.families = 3; }), {"3 fibre families", "one or two"}},
      {fibres_with([](HolzapfelLaw& law) { law.directions.clear(); }), {"2 fibre families have 0 directions"}},
      {fibres_with([](HolzapfelLaw& law) { law.directions[1].setZero(); }), {"(0, 0, 0) has length 0", "unit"}},
      {{NeoHookeanLaw{mu}, bulk, {{0.5, 1}, {0.5, 2}}}, {"add to 1;", "below 1"}},
      {{NeoHookeanLaw{mu}, bulk, {{0, 1}}}, {"share of term 1 is 0", "between 0 and 1"}},
      {{NeoHookeanLaw{mu}, bulk, {{0.2, 1}, {0.2, -3}}}, {"time of term 2 is -3 s", "positive"}},
      {{NeoHookeanLaw{mu}, bulk, {{0.1, 1}, {0.1, 2}, {0.1, 3}, {0.1, 4}}}, {"4 terms", "up to 3"}},
  };
  for (const auto& [spec, parts] : refused)
    for (const std::string& part : parts)
      CHECK_THROWS_WITH(make_law(spec), Contains(part));
}

TEST_CASE("Poisson's ratio up to 0.499 is taken, of the linear law any below 0.5") {
  CHECK_NOTHROW(make_law({NeoHookeanLaw{mu}, bulk_modulus_of(mu, 0.499), {}}));
  CHECK_NOTHROW(make_law({LinearLaw{mu}, bulk_modulus_of(mu, 0.4999), {}}));
}

TEST_CASE("Laws that are polyconvex are elliptic everywhere") {
  for (const double nu : {0.0, 0.3, 0.499})
    for (const LawSpec& spec :
         {LawSpec{LinearLaw{mu}, bulk_modulus_of(mu, nu), {}}, LawSpec{NeoHookeanLaw{mu}, bulk_modulus_of(mu, nu), {}},
          LawSpec{YeohLaw{mu, 0.1 * mu, 0.1 * mu}, bulk_modulus_of(mu, nu), {}},
          LawSpec{OgdenLaw{{{mu, 2}}}, bulk_modulus_of(mu, nu), {}},
          LawSpec{tests::sample_fibres(0.1), bulk_modulus_of(mu, nu), {}}}) {
      INFO(law_name(spec) << ", nu = " << nu);
      if (std::holds_alternative<LinearLaw>(spec.law))
        CHECK_FALSE(find_loss(spec, 1.2)); // beyond it has no homogeneous state
      else
        CHECK_FALSE(find_loss(spec, 3));
    }
}

// Abeyaratne (1980), in the plane of two principal stretches of an incompressible body with W(I1):
// W' + 2 W'' (l1 - l2)^2 > 0. Here W' = c1 + 2 c2 (I1 - 3), W'' = 2 c2.
TEST_CASE("A Yeoh law with negative c2 loses ellipticity where theory says") {
  for (const double ratio : {-0.05, -0.1, -0.15, -0.3}) {
    const auto lost = [ratio](double a, double b, double c) {
      const double first = a * a + b * b + c * c - 3;
      const double shear = std::max({(a - b) * (a - b), (a - c) * (a - c), (b - c) * (b - c)});
      return 1 + 2 * ratio * first + 4 * ratio * shear <= 0;
    };
    double least = infinite;
    for (const int sign : {1, -1})
      for (double strain = 0; strain < (sign > 0 ? 1 : 0.5); strain += 1e-4) {
        const double l = 1 + sign * strain;
        const bool two = l > std::sqrt(0.5) && l < std::sqrt(2); // the third stretch is within 0.5 and 2
        if (lost(l, 1 / std::sqrt(l), 1 / std::sqrt(l)) || (two && lost(l, l, 1 / (l * l))) || lost(l, 1, 1 / l)) {
          least = std::min(least, strain);
          break;
        }
      }
    const double c1 = 0.5 * mu;
    const LawSpec spec{YeohLaw{c1, ratio * c1, 0}, bulk_modulus_of(mu, 0.499), {}};
    const std::optional<EllipticityLoss> loss = find_loss(spec, 2);
    CHECK(loss.has_value() == (least < infinite));
    CHECK(loss.has_value() == (ratio < -0.05));
    if (!loss)
      continue;
    INFO("c2 / c1 = " << ratio << ": " << loss->path << ", " << loss->strain);
    CHECK(std::abs(loss->strain) == Approx(least).margin(0.025)); // steps of 2 %, directions 7.5 degrees apart
    CHECK_THROWS_WITH(make_law(spec), Contains("law yeoh: c2 is -") && Contains("strong ellipticity is lost in ") &&
                                          Contains(loss->path) && Contains(" at a strain of ") &&
                                          Contains("stretches of 0.5 and 2; with the other constants it holds from -"));
  }
}

TEST_CASE("The limit that is told for an unstable constant holds") {
  const double c1 = 0.5 * mu;
  const auto with = [&](double c2) { return LawSpec{YeohLaw{c1, c2, 0}, bulk, {}}; };
  std::string said;
  try {
    make_law(with(-0.2 * c1));
  } catch (const InputError& error) {
    said = error.what();
  }
  const std::string before = "it holds from ";
  REQUIRE(said.find(before) != std::string::npos);
  const double limit = std::stod(said.substr(said.find(before) + before.size()));
  CHECK_NOTHROW(make_law(with(0.99 * limit)));
  CHECK_THROWS_AS(make_law(with(1.05 * limit)), InputError);
}

TEST_CASE("An Ogden law with an opposing term is refused with that term") {
  const LawSpec spec{OgdenLaw{{{mu, 2}, {-0.2 * mu, 6}}}, bulk, {}};
  REQUIRE(small_strain_moduli(spec).shear_modulus > 0);
  CHECK_THROWS_WITH(make_law(spec),
                    Contains("law ogden: the modulus of term 2 is -600 Pa: strong ellipticity is lost"));
}
