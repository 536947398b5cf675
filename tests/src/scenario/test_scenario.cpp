#include "src/scenario/document.hpp"
#include "src/scenario/keys.hpp"
#include "src/scenario/scenario.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

std::string complaint_after(const std::string& from, const std::string& to) {
  return complaint(replaced(small_scenario, from, to));
}

Scenario read(const std::string& text) {
  const TemporaryFolder folder;
  return read_scenario(write_file(folder.path() / "case.toml", text));
}

} // namespace

TEST_CASE("A scenario is read with its values and the documented defaults") {
  const Scenario scenario = read(small_scenario);
  CHECK(scenario.title == "small");
  CHECK(std::get<BlockOrgan>(scenario.organ.shape).size == Vector3(0.06, 0.06, 0.03));
  CHECK(scenario.organ.edge == 0.006);
  CHECK(scenario.material.young_modulus == 1e4);
  CHECK(scenario.material.density == 1060);
  REQUIRE(scenario.fixed.size() == 1);
  CHECK(scenario.fixed[0].holds({0.02, 0.01, 0}));
  CHECK_FALSE(scenario.fixed[0].holds({0, 0, 0.002}));
  CHECK(scenario.nodes.slope == 0.3);
  CHECK(scenario.nodes.random_seed == 1);
  CHECK(scenario.method.method == solvers::Method::galerkin);
  CHECK(scenario.method.support_radius == 0);
  CHECK_FALSE(scenario.method.cut_ahead);
  CHECK_FALSE(scenario.gravity);
  CHECK(std::get<topology::SphereTip>(scenario.tool->shape).radius == 0.01);
  const auto& approach = std::get<Approach>(scenario.tool->motion);
  CHECK(approach.depth == 0.002);
  CHECK(approach.duration == 1);
  CHECK(scenario.contact.condition == solvers::ContactCondition::frictionless);
  CHECK(scenario.output.vtp_every == 1);
  CHECK_FALSE(scenario.output.figures);
}

TEST_CASE("Friction of the tool is read, with 0.3 where only the condition is given") {
  const Scenario said = read(small_scenario + "[contact]\ncondition = \"frictional\"\n");
  CHECK(said.contact.condition == solvers::ContactCondition::frictional);
  CHECK(said.contact.friction == 0.3);
  CHECK(read(small_scenario + "[contact]\ncondition = \"frictional\"\nfriction = 0.15\n").contact.friction == 0.15);
}

TEST_CASE("Fixed regions hold the points inside them") {
  const Scenario scenario = read(small_scenario + R"(
[[fixed]]
region = "sphere"
centre = [0.01, 0, 0]
radius = 0.005
axes = ["z"]
[[fixed]]
region = "half_space"
point = [0, 0, 0.01]
normal = [0, 0, 2]
)");
  REQUIRE(scenario.fixed.size() == 3);
  CHECK(scenario.fixed[1].holds({0.0149, 0, 0}));
  CHECK_FALSE(scenario.fixed[1].holds({0.0151, 0, 0}));
  CHECK(scenario.fixed[1].components == std::array<bool, 3>{false, false, true});
  CHECK(scenario.fixed[2].holds({3, 4, 0.00999}));
  CHECK_FALSE(scenario.fixed[2].holds({3, 4, 0.0101}));
  CHECK(scenario.fixed[2].name == "3");
}

TEST_CASE("Every offence of a scenario names file, line, key, value and what is allowed") {
  struct Case {
    std::string from, to;
    std::vector<std::string> expected;
  };
  const std::vector<Case> cases = {
      {"poisson_ratio = 0.3", "poisson_ratio = 0.5", {"case.toml:8:", "material.poisson_ratio", "0.5", "<= 0.499"}},
      {"poisson_ratio = 0.3", "poisson_ratio = -0.1", {":8:", "material.poisson_ratio", "-0.1", "0 <= value"}},
      {"young_modulus = 1e4", "young_modulus = 0", {":7:", "material.young_modulus", "= 0 Pa", "<= value"}},
      {"young_modulus = 1e4", "young_modulus = nan", {":7:", "material.young_modulus", "nan"}},
      {"young_modulus = 1e4",
       "young_modulus = \"10 kPa\"",
       {":7:", "material.young_modulus", "10 kPa", "a number in pascals, without the unit"}},
      {"radius = 0.01\n", "radius = \"10 mm\"\n", {":20:", "tool.radius", "10 mm", "metres"}},
      {"size = [0.06, 0.06, 0.03]", "size = [60, 60, 30]", {":4:", "organ.size", "60", "<= 10"}},
      {"size = [0.06, 0.06, 0.03]", "size = [0.06, 0.06]", {":4:", "organ.size", "array of three numbers"}},
      {"size = [0.06, 0.06, 0.03]", "size = [0.06, inf, 0.06]", {":4:", "organ.size", "out of range"}},
      {"size = [0.06, 0.06, 0.03]\n", "", {"organ.size is missing", "metres"}},
      {"shape = \"block\"", "shape = \"spleen\"", {":3:", "organ.shape", "spleen", "hemisphere"}},
      {"edge = 0.006", "egde = 0.006", {":5:", "unknown key 'organ.egde'", "did you mean 'edge'"}},
      {"edge = 0.006", "triangles = 5000", {":5:", "organ.triangles", "5000", "shape = liver"}},
      {"[nodes]", "[noodles]\n[nodes]", {":14:", "unknown key 'noodles'", "nodes"}},
      {"fine_spacing = 0.004", "fine_spacing = 0.02", {":16:", "coarse_spacing", "0.012", "0.02"}},
      {"fine_radius = 0.006", "count = 3.5", {":17:", "nodes.count", "3.5", "whole number"}},
      {"lower = [-1, -1, -0.001]", "lower = [-1, -1, 0.1]", {":12:", "fixed[1].lower", "0.1", "upper"}},
      {"region = \"box\"", "region = \"cone\"", {":11:", "fixed[1].region", "cone", "half_space"}},
      {"target = [0, 0, 0.03]", "target = [0, 0, nan]", {":23:", "tool.approach.target", "nan", "<= each <="}},
      {"direction = [0, 0, -1]", "direction = [0, 0, 0]", {":24:", "tool.approach.direction", "no direction"}},
      {"direction = [0, 0, -1]", "direction = [0, 0, 1]", {":24:", "tool.approach.direction", "backwards"}},
      {"step = 0.25", "step = 2.0", {":21:", "tool.step", "2 s", "1 s"}},
      {"figures = false", "figures = 1", {":28:", "output.figures", "true or false"}},
      {"depth = 0.002\n", "", {"tool.approach.depth is missing"}},
      {"step = 0.25\n",
       "step = 0.25\npath = [{time = 0, position = [0,0,1]}, {time = 1, position = [0,0,0]}]\n",
       {":18:", "both approach and path", "one of the two"}},
      {"[output]", "[contact]\nfriction = 0.2\n[output]", {":28:", "contact.friction", "condition = frictional"}},
      {"[output]",
       "[contact]\ncondition = \"frictional\"\nfriction = -0.1\n[output]",
       {":29:", "contact.friction", "-0.1", "0 <= value <= 2"}},
      {"title = \"small\"", "title = \"small\"\ngravity = 3", {":2:", "gravity = 3: must be a table"}},
  };
  for (const Case& c : cases) {
    const std::string said = complaint_after(c.from, c.to);
    INFO(c.to << "\nsaid: " << said);
    for (const std::string& part : c.expected)
      CHECK_THAT(said, Contains(part));
  }
}

TEST_CASE("All offences of a scenario are reported at once, by line") {
  std::string text = replaced(small_scenario, "young_modulus = 1e4", "young_modulus = -1");
  text = replaced(text, "radius = 0.01\n", "radius = true\n");
  text = replaced(text, "title = \"small\"", "name = \"small\"");
  const std::string said = complaint(text);
  const auto name = said.find("unknown key 'name'");
  const auto young = said.find("material.young_modulus");
  const auto radius = said.find("tool.radius");
  REQUIRE(radius != std::string::npos);
  CHECK(name < young);
  CHECK(young < radius);
}

TEST_CASE("A direction of no length is one offence, without what follows from it") {
  const auto is_alone = [](const std::string& said, const std::string& name) {
    INFO(said);
    CHECK_THAT(said, Contains(name + " = [0, 0, 0]: has no direction"));
    CHECK(std::count(said.begin(), said.end(), '\n') == 0);
  };
  is_alone(complaint_after("direction = [0, 0, -1]", "direction = [0, 0, 0]"), "tool.approach.direction");
  is_alone(complaint(replaced(replaced(small_scenario, "step = 0.25", "axis = [0, 0, 0]\nstep = 0.25"),
                              "direction = [0, 0, -1]", "direction = [0, 0, 1]")),
           "tool.axis");
  const auto sheet = [](const std::string& normal, const std::string& up) {
    return complaint(cut_block + rectangle_precut("[0, 0, 0.02]", normal, up, "0.02", "0.01"));
  };
  is_alone(sheet("[0, 0, 1]", "[0, 0, 0]"), "precut[1].up");
  is_alone(sheet("[0, 0, 0]", "[0, 0, 1]"), "precut[1].normal");
  is_alone(complaint(cut_block + disc_precut +
                     "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 0]\nnormal = [0, 0, 0]\n"),
           "fixed[2].normal");
}

TEST_CASE("Nothing fixed is refused by the reader") {
  const std::string region = "[[fixed]]\nname = \"base\"\nregion = \"box\"\nlower = [-1, -1, -0.001]\n"
                             "upper = [1, 1, 0.001]\n";
  CHECK_THAT(complaint_after(region, ""), Contains("fixed is missing") && Contains("At least one region"));
  CHECK_THAT(complaint("fixed = []\n" + replaced(small_scenario, region, "")), Contains("nothing is fixed"));
  CHECK_THAT(complaint(replaced(small_scenario, "[[fixed]]\n", "[[fixed]]\naxes = [\"z\"]\n")),
             Contains("no region holds x") && Contains("no region holds y") && !Contains("no region holds z"));
}

TEST_CASE("Paths need two poses and rising times") {
  const auto with_path = [](const std::string& path) {
    const auto from = small_scenario.find("[tool.approach]");
    const auto to = small_scenario.find("[output]");
    return small_scenario.substr(0, from) + path + small_scenario.substr(to);
  };
  CHECK(complaint(with_path("[[tool.path]]\ntime = 0\nposition = [0, 0, 0.04]\n[[tool.path]]\ntime = 1\n"
                            "position = [0, 0, 0.02]\n")) == "");
  CHECK_THAT(complaint(with_path("[[tool.path]]\ntime = 0\nposition = [0, 0, 0.04]\n")), Contains("two or more"));
  CHECK_THAT(complaint(with_path("[[tool.path]]\ntime = 1\nposition = [0, 0, 0.04]\n[[tool.path]]\ntime = 1\n"
                                 "position = [0, 0, 0.02]\n")),
             Contains("tool.path[2].time = 1 s") && Contains("above 1 s"));
  CHECK_THAT(complaint(with_path("")), Contains("neither approach nor path"));
}

TEST_CASE("Files that are not scenarios are refused with their name") {
  const TemporaryFolder folder;
  const auto complaint_about = [](const std::filesystem::path& file) -> std::string {
    try {
      static_cast<void>(read_scenario(file));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  CHECK_THAT(complaint_about(folder.path() / "none.toml"), Contains("none.toml") && Contains("no such file"));
  CHECK_THAT(complaint_about(folder.path()), Contains("folder"));
  CHECK_THAT(complaint_about(write_file(folder.path() / "empty.toml", "")), Contains("organ is missing"));
  CHECK_THAT(complaint_about(write_file(folder.path() / "broken.toml", "[organ]\nshape = ")),
             Contains("broken.toml:2:") && Contains("not TOML"));
  std::string garbage;
  for (int i = 0; i < 4000; ++i)
    garbage += static_cast<char>((i * 7919) % 251);
  CHECK_THAT(complaint_about(write_file(folder.path() / "garbage.toml", garbage)), Contains("garbage.toml:"));
  CHECK_THAT(complaint_about(write_file(folder.path() / "case.toml",
                                        replaced(replaced(replaced(small_scenario, "shape = \"block\"",
                                                                   "shape = \"file\"\nfile = \"nowhere.obj\""),
                                                          "size = [0.06, 0.06, 0.03]\n", ""),
                                                 "edge = 0.006\n", ""))),
             Contains("case.toml:4:") && Contains("nowhere.obj"));
}

TEST_CASE("Every default in the table of keys is a value that the reader would take") {
  for (const ScenarioKey& key : scenario_keys()) {
    INFO(key.path);
    if (key.fallback.empty() || key.fallback == "required")
      continue;
    if (key.kind == KeyKind::number || key.kind == KeyKind::integer)
      CHECK(key.range.holds(std::stod(std::string(key.fallback))));
    if (key.kind == KeyKind::choice)
      CHECK_THAT(std::string(key.choices), Contains(std::string(key.fallback.substr(1, key.fallback.size() - 2))));
  }
}

TEST_CASE("docs/scenario.md holds the reference written from the table of keys") {
  const std::string page = read_file(std::filesystem::path(SPHERECUT_SOURCE_DIR) / "docs/scenario.md");
  const std::string reference = scenario_reference();
  for (const ScenarioKey& key : scenario_keys()) {
    INFO(key.path);
    CHECK_THAT(reference, Contains(std::string(key.meaning)));
  }
  INFO("write the part anew with: spherecut scenario-help --markdown");
  CHECK_THAT(page, Contains(reference));
}

TEST_CASE("Every scenario of the repository can be read") {
  int count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(SPHERECUT_SOURCE_DIR) / "scenarios"))
    if (entry.path().extension() == ".toml") {
      INFO(entry.path());
      CHECK_NOTHROW(read_scenario(entry.path()));
      ++count;
    }
  CHECK(count >= 4);
}
