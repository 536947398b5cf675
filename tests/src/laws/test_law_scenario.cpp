// The law of a scenario's material: read, checked, told, and refused where no body is computed with it.
#include "src/scenario/law_reader.hpp"
#include "src/scenario/scenario.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

const std::string elastic = "young_modulus = 1e4\npoisson_ratio = 0.3\n"; // line 7 and 8 of the small scenario

Scenario with_material(const std::string& lines) {
  return read_scenario_text("law.toml", replaced(small_scenario, elastic, lines));
}

const std::string neo_hookean = "law = \"neo_hookean\"\nyoung_modulus = 1e4\npoisson_ratio = 0.49\n";
const std::string yeoh = "law = \"yeoh\"\npoisson_ratio = 0.49\nc1 = 1500\nc2 = 100\nc3 = 50\n";
const std::string ogden = "law = \"ogden\"\npoisson_ratio = 0.45\n[[material.ogden]]\nmodulus = 1e3\nexponent = 4\n"
                          "[[material.ogden]]\nmodulus = -500\nexponent = -2\n";
const std::string fibres = "law = \"holzapfel_gasser_ogden\"\nyoung_modulus = 1e4\npoisson_ratio = 0.45\n"
                           "fibre_modulus = 2e3\nfibre_exponent = 1.5\nfibre_dispersion = 0.1\n"
                           "[[material.fibre]]\ndirection = [3, 4, 0]\n";
const std::string prony = "[[material.prony]]\nshare = 0.3\ntime = 2\n[[material.prony]]\nshare = 0.2\ntime = 0.1\n";

} // namespace

TEST_CASE("Without a law the material is linear, as it stands in the file") {
  const Scenario scenario = with_material(elastic);
  CHECK(std::get<solvers::LinearLaw>(scenario.law.spec.law).shear_modulus == Approx(1e4 / 2.6));
  CHECK(scenario.law.spec.prony.empty());
  CHECK(scenario.material.young_modulus == 1e4);
  CHECK(scenario.material.poisson_ratio == 0.3);
  CHECK_FALSE(is_nonlinear(scenario.law));
  CHECK_NOTHROW(require_linear("law.toml", scenario.law));
}

TEST_CASE("Every law is read with its constants, and the scenario has its moduli at small strain") {
  const Scenario first = with_material(neo_hookean + prony);
  CHECK(std::get<solvers::NeoHookeanLaw>(first.law.spec.law).shear_modulus == Approx(1e4 / 2.98));
  REQUIRE(first.law.spec.prony.size() == 2);
  CHECK(first.law.spec.prony[1].share == 0.2);
  CHECK(first.law.spec.prony[1].time == 0.1);

  const Scenario second = with_material(yeoh);
  const auto& polynomial = std::get<solvers::YeohLaw>(second.law.spec.law);
  CHECK(polynomial.c1 == 1500);
  CHECK(polynomial.c2 == 100);
  CHECK(polynomial.c3 == 50);
  CHECK(second.material.young_modulus == Approx(2 * 3000 * 1.49));
  CHECK(second.material.poisson_ratio == 0.49);

  const Scenario third = with_material(ogden);
  const auto& terms = std::get<solvers::OgdenLaw>(third.law.spec.law).terms;
  REQUIRE(terms.size() == 2);
  CHECK(terms[1].modulus == -500);
  CHECK(terms[1].exponent == -2);
  CHECK(third.material.young_modulus == Approx(2 * 2500 * 1.45));

  const Scenario fourth = with_material(fibres);
  const auto& law = std::get<solvers::HolzapfelLaw>(fourth.law.spec.law);
  CHECK(law.families == 1);
  CHECK(law.same_everywhere);
  CHECK(law.directions[0].isApprox(Vector3(0.6, 0.8, 0)));
  CHECK(law.dispersion == 0.1);
  CHECK(fourth.material.young_modulus == 1e4);
  for (const Scenario* scenario : {&first, &second, &third, &fourth})
    CHECK(is_nonlinear(scenario->law));
}

TEST_CASE("Fibres run straight, away from a line, or away from a point") {
  const std::string radial = replaced(fibres, "direction = [3, 4, 0]", "course = \"radial\"\ncentre = [0.01, 0, 0]");
  const Scenario straight = with_material(fibres), from_point = with_material(radial),
                 from_line = with_material(radial + "axis = [0, 0, 2]\n[[material.fibre]]\ndirection = [0, 0, 5]\n");
  const Vector3 x(0.04, 0.04, 0.05);
  CHECK(straight.law.fibres_at(x).direction[0].isApprox(Vector3(0.6, 0.8, 0)));
  CHECK(straight.law.fibres_at(x).direction[1].isZero(0));
  CHECK(from_point.law.fibres_at(x).direction[0].isApprox(Vector3(0.03, 0.04, 0.05).normalized()));
  CHECK(from_line.law.fibres_at(x).direction[0].isApprox(Vector3(0.6, 0.8, 0)));
  CHECK(from_line.law.fibres_at(x).direction[1].isApprox(Vector3::UnitZ()));
  CHECK(from_line.law.fibres_at({0.01, 0, 0.3}).direction[0].isZero(0));
  const auto& law = std::get<solvers::HolzapfelLaw>(from_line.law.spec.law);
  CHECK(law.families == 2);
  CHECK_FALSE(law.same_everywhere);
}

TEST_CASE("What is wrong with a law is told with its line") {
  const auto refused = [](const std::string& lines, const std::string& part) {
    INFO(lines);
    CHECK_THROWS_WITH(with_material(lines), Contains("law.toml:") && Contains(part));
  };
  refused(replaced(neo_hookean, "neo_hookean", "neo_hooke"),
          "7: material.law = 'neo_hooke': out of range; allowed: one of: linear, ");
  refused(replaced(neo_hookean, "0.49", "0.5"),
          "9: material.poisson_ratio = 0.5: out of range; allowed: 0 <= value <= 0.499");
  refused(replaced(neo_hookean, "young_modulus = 1e4\n", ""), "material.young_modulus is missing");
  refused(yeoh + "young_modulus = 1e4\n", "young_modulus = 10000: goes only with law = ");
  refused(replaced(yeoh, "c1 = 1500\n", ""), "material.c1 is missing");
  refused(replaced(yeoh, "c1 = 1500", "c1 = -1500"), "material.c1 = -1500 Pa: out of range");
  refused(replaced(yeoh, "c2 = 100", "c2 = -500"),
          "7: material: law yeoh: c2 is -500 Pa: strong ellipticity is lost in ");
  refused(elastic + "c2 = 1\n", "material.c2 = 1: goes only with law = yeoh");
  refused("law = \"ogden\"\npoisson_ratio = 0.45\n", "material.ogden is missing");
  refused(replaced(ogden, "exponent = 4", "exponent = 0"), "exponent of term 1 is 0");
  refused(replaced(fibres, "[[material.fibre]]\ndirection = [3, 4, 0]\n", ""), "material.fibre is missing");
  refused(replaced(fibres, "[3, 4, 0]", "[0, 0, 0]"), "material.fibre[1].direction = [0, 0, 0]: has no direction");
  refused(replaced(fibres, "direction = [3, 4, 0]\n", ""), "material.fibre[1].direction is missing");
  refused(replaced(fibres, "direction = [3, 4, 0]", "course = \"radial\""), "material.fibre[1].centre is missing");
  refused(fibres + "centre = [0, 0, 0]\n", "goes only with course = radial");
  const std::string one = "[[material.fibre]]\ndirection = [1, 0, 0]\n";
  refused(fibres + one + one, "3 fibre families; one or two");
  refused(elastic + replaced(prony, "share = 0.2", "share = 0.7"), "shares add to 1; the sum must be below 1");
  refused(elastic + replaced(prony, "time = 2\n", "time = 0\n"), "material.prony[1].time = 0 s: out of range");
  refused(elastic + prony + prony, "4 terms; up to 3");
}

TEST_CASE("check tells the law with its moduli, and whether a run of it is refused") {
  const TemporaryFolder folder;
  const auto check_of = [&](const std::string& lines) {
    return run_spherecut(
        {"check", write_file(folder.path() / "law.toml", replaced(small_scenario, elastic, lines)).string()});
  };
  const auto check = [&](const std::string& lines) {
    const ProgramResult result = check_of(lines);
    CHECK(result.status == 0);
    CHECK_THAT(result.out, Contains(": good"));
    return result.out;
  };
  CHECK_THAT(check(elastic), Contains("law linear, at small strain E = 1e+04 Pa, nu = 0.3"));
  CHECK_THAT(check(yeoh), Contains("law yeoh, at small strain E = 8940 Pa, nu = 0.49 (shear modulus 3000 Pa"));
  const ProgramResult refused = check_of(elastic + prony);
  CHECK(refused.status == 2);
  CHECK_THAT(refused.err, Contains("material.prony does not go with"));
  CHECK_THAT(refused.out, Contains("law linear, at small strain") && !Contains("good"));
  CHECK_THAT(check(neo_hookean), Contains("estimate: 0.") && Contains(" GB; 0.0") && Contains(" s for the 5 steps"));
  CHECK_THAT(check(fibres), Contains("1 family of fibres") && Contains("3920 Pa along them")); // 4 k1 (1 - 3 d)^2
  // Half of the shear modulus fades: E = 9 K G / (3 K + G).
  const double shear = 1e4 / 2.98, bulk = solvers::bulk_modulus_of(shear, 0.49), left = 0.5 * shear;
  CHECK_THAT(check(neo_hookean + prony),
             Contains(fmt::format("after a long time E = {:.4g} Pa", 9 * bulk * left / (3 * bulk + left))));
}

TEST_CASE("What a law does not go with is refused in a hand with its line before anything is written") {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder.path() / "out";
  const auto program = [&](const std::string& command, const std::string& lines) {
    const std::filesystem::path file = write_file(folder.path() / "law.toml", replaced(small_scenario, elastic, lines));
    std::vector<std::string> arguments{command, file.string(), "--out", out.string()};
    if (command == "haptics")
      arguments.insert(arguments.end(), {"--virtual", "--duration", "0.1"});
    const ProgramResult result = run_spherecut(arguments);
    CHECK(result.status == 2);
    CHECK_FALSE(std::filesystem::exists(out));
    return result.err;
  };
  CHECK_THAT(program("haptics", elastic + prony),
             Contains("material.prony does not go with material.law = \"linear\""));
  CHECK_THAT(program("run", elastic + prony), Contains("material.prony does not go with material.law = \"linear\""));
  // A session that another way in has made computes no linear body in its place either.
  Session session(with_material(elastic + prony));
  CHECK_THROWS_WITH(run(session), Contains("material.prony does not go with"));
}
