// [[material.region]]: what is read, where a region is, what is refused, and what it does to a press.
#include "src/scenario/region_reader.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "topology/files/surface_io.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

std::string with_region(const std::string& keys, const std::string& scenario = small_scenario) {
  return scenario + "[[material.region]]\nname = \"part\"\nyoung_modulus = 2e5\npoisson_ratio = 0.4\n" + keys;
}

const std::string ball_region = "shape = \"sphere\"\ncentre = [0, 0, 0.012]\nradius = 0.008\n";

bool holds(const std::string& keys, const Vector3& x) {
  const Scenario scenario = scenario_of(with_region(keys));
  const auto organ = topology::make_box_domain({-0.03, -0.03, 0}, {0.03, 0.03, 0.03}, 0.006);
  return regions_of(scenario, organ)->at(x) == 0;
}

double pressing_force(const std::string& text) {
  Session session = session_of(text);
  return run(session).back().force.norm();
}

} // namespace

TEST_CASE("A region is read with its shape, its moduli and the density that it may leave out") {
  const Scenario scenario =
      scenario_of(with_region(ball_region + "density = 1200\n[[material.region]]\nshape = \"depth\"\nto = 0.002\n"
                                            "young_modulus = 3e4\npoisson_ratio = 0.3\n"));
  REQUIRE(scenario.regions.size() == 2);
  CHECK(scenario.regions[0].name == "part");
  CHECK(scenario.regions[0].material.young_modulus == 2e5);
  CHECK(scenario.regions[0].material.poisson_ratio == 0.4);
  CHECK(scenario.regions[0].material.density == 1200);
  CHECK(std::get<SphereRegion>(scenario.regions[0].shape).radius == 0.008);
  CHECK(scenario.regions[1].name == "2");
  CHECK(scenario.regions[1].material.density == 1060);
  CHECK(std::get<DepthRegion>(scenario.regions[1].shape).from == 0);
  CHECK(regions_of(scenario_of(small_scenario), nullptr) == nullptr);
  CHECK_THAT(regions_text(scenario.regions), Contains("'part': E = 2e+05 Pa, nu = 0.4"));
}

TEST_CASE("Every shape of a region holds what is inside it") {
  CHECK(holds(ball_region, {0, 0.007, 0.012}));
  CHECK_FALSE(holds(ball_region, {0, 0.009, 0.012}));
  const std::string box = "shape = \"box\"\nlower = [-0.01, -0.01, 0]\nupper = [0.01, 0.01, 0.02]\n";
  CHECK(holds(box, {0.009, -0.009, 0.019}));
  CHECK_FALSE(holds(box, {0.009, -0.009, 0.021}));
  const std::string slab = "shape = \"slab\"\npoint = [0, 0, 0.01]\nnormal = [0, 0, 3]\nthickness = 0.004\n";
  CHECK(holds(slab, {0.02, 0, 0.0119}));
  CHECK(holds(slab, {0.02, 0, 0.0081}));
  CHECK_FALSE(holds(slab, {0.02, 0, 0.0121}));
  CHECK_FALSE(holds(slab, {0.02, 0, 0.0079}));
  const std::string half = "shape = \"half_space\"\npoint = [0, 0, 0.01]\nnormal = [0, 0, -1]\n";
  CHECK(holds(half, {0, 0, 0.02}));
  CHECK_FALSE(holds(half, {0, 0, 0.009}));
  const std::string layer = "shape = \"depth\"\nfrom = 0.002\nto = 0.004\n";
  CHECK(holds(layer, {0, 0, 0.027}));
  CHECK(holds(layer, {0.027, 0, 0.015}));
  CHECK_FALSE(holds(layer, {0, 0, 0.029}));
  CHECK_FALSE(holds(layer, {0, 0, 0.025}));
}

TEST_CASE("A region inside a closed surface is read from its file") {
  const TemporaryFolder folder;
  topology::write_surface(folder.path() / "part.obj",
                          topology::make_box_domain({-0.01, -0.01, 0.005}, {0.01, 0.01, 0.02}, 0.005)->surface());
  const Scenario scenario =
      read_scenario(write_file(folder.path() / "case.toml", with_region("shape = \"file\"\nfile = \"part.obj\"\n")));
  const auto regions = regions_of(scenario, nullptr);
  CHECK(regions->at({0.009, 0.009, 0.019}) == 0);
  CHECK(regions->at({0.011, 0.009, 0.019}) == -1);
}

TEST_CASE("Every offence of a region names file, line, key, value and what is allowed") {
  struct Case {
    std::string text;
    std::vector<std::string> expected;
  };
  const std::string nonlinear =
      replaced(small_scenario, "young_modulus = 1e4", "law = \"neo_hookean\"\nyoung_modulus = 1e4");
  const std::vector<Case> cases = {
      {with_region("shape = \"cone\"\n"), {"case.toml:33:", "material.region[1].shape", "cone", "half_space"}},
      {with_region(replaced(ball_region, "radius = 0.008", "radius = -1")), {":35:", "radius", "-1 m"}},
      {with_region(replaced(ball_region, "radius = 0.008\n", "")), {"material.region[1].radius is missing"}},
      {replaced(with_region(ball_region), "poisson_ratio = 0.4", "poisson_ratio = 0.5"), {":32:", "0.5", "<= 0.499"}},
      {replaced(with_region(ball_region), "young_modulus = 2e5\n", ""),
       {"material.region[1].young_modulus is missing"}},
      {with_region("shape = \"box\"\nlower = [0, 0, 0.02]\nupper = [0.01, 0.01, 0.01]\n"),
       {":34:", "material.region[1].lower: z = 0.02 m", "0.01 m", "lower < upper"}},
      {with_region("shape = \"depth\"\nfrom = 0.004\nto = 0.002\n"), {":35:", "to = 0.002 m", "from = 0.004 m"}},
      {with_region("shape = \"slab\"\npoint = [0, 0, 0]\nnormal = [0, 0, 0]\nthickness = 0.01\n"),
       {":35:", "material.region[1].normal", "no direction"}},
      {with_region("shape = \"file\"\nfile = \"none.obj\"\n"), {":34:", "material.region[1].file", "none.obj"}},
      {with_region(ball_region + "thickness = 1\n"), {":36:", "thickness", "shape = slab"}},
      {with_region(ball_region, small_scenario + "[method]\nname = \"collocation\"\n"),
       {"material.region with method.name = \"collocation\"", "galerkin"}},
      {with_region(ball_region, nonlinear), {"material.region with material.law = \"neo_hookean\"", "linear"}},
      {with_region(ball_region, small_scenario + disc_precut), {"material.region with precuts", "without"}},
  };
  for (const Case& c : cases) {
    const std::string said = complaint(c.text);
    INFO(c.text << "\nsaid: " << said);
    for (const std::string& part : c.expected)
      CHECK_THAT(said, Contains(part));
  }
}

TEST_CASE("A press feels the regions: as the material itself where one is everywhere, between both where a ball is") {
  const double soft = pressing_force(small_scenario);
  const std::string everywhere = "shape = \"half_space\"\npoint = [0, 0, 1]\nnormal = [0, 0, 1]\n";
  const std::string twenty =
      replaced(replaced(small_scenario, "1e4", "2e5"), "poisson_ratio = 0.3", "poisson_ratio = 0.4");
  const double stiff = pressing_force(twenty);
  CHECK(pressing_force(with_region(everywhere)) == Approx(stiff).epsilon(1e-6));
  const double with_ball = pressing_force(with_region(ball_region));
  CHECK(with_ball > 1.1 * soft);
  CHECK(with_ball < 0.5 * stiff);
}

TEST_CASE("Regions that overlap or lie outside the organ stop a session by name") {
  const std::string two = ball_region +
                          "[[material.region]]\nname = \"layer\"\nshape = \"slab\"\npoint = [0, 0, 0.01]\n"
                          "normal = [0, 0, 1]\nthickness = 0.005\nyoung_modulus = 1e5\npoisson_ratio = 0.3\n";
  // Before nodes are made: `spherecut check` makes a session and no body.
  CHECK_THROWS_WITH(session_of(with_region(two)),
                    Contains("case.toml:29: material regions 'part' and 'layer' overlap"));
  CHECK_THROWS_WITH(pressing_force(with_region(replaced(ball_region, "0.012", "0.2"))),
                    Contains("'part' holds none of the"));
}
