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

std::string complaint_about(const std::string& addition) {
  return complaint(cut_block + addition);
}

const std::string two_poses = "[[blade.path]]\ntime = 0\nposition = [0, 0, 0]\n"
                              "[[blade.path]]\ntime = 1\nposition = [0.1, 0, 0]\n";

} // namespace

TEST_CASE("Cuts are read with their values and the documented defaults") {
  const Scenario scenario = scenario_of(cut_block + R"(
[[precut]]
shape = "disc"
centre = [0, 0, 0.015]
normal = [0, 0, 2]
radius = 0.01
pressure = 100
)" + rectangle_precut("[0.01, 0, 0.02]", "[1, 0, 0]", "[1, 0, 1]", "0.02", "0.01") +
                                        R"([[precut]]
shape = "polygon"
points = [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]]
[blade]
edge = [[0, 0, -0.01], [0, 0, 0.01]]
[[blade.path]]
time = 0
position = [-0.1, 0, 0]
[[blade.path]]
time = 2
position = [0.1, 0, 0]
rotation = [0, 0, 90]
)");
  CHECK_FALSE(scenario.tool);
  REQUIRE(scenario.precuts.size() == 3);
  const auto& disc = std::get<DiscSheet>(scenario.precuts[0].shape);
  CHECK(disc.normal == Vector3(0, 0, 1));
  CHECK(disc.radius == 0.01);
  CHECK(scenario.precuts[0].pressure == 100);
  CHECK(scenario.precuts[1].pressure == 0);
  const auto& rectangle = std::get<RectangleSheet>(scenario.precuts[1].shape);
  CHECK(rectangle.up.isApprox(Vector3(0, 0, 1)));
  CHECK(std::get<PolygonSheet>(scenario.precuts[2].shape).points[1] == Vector3(0.01, 0, 0));
  CHECK_FALSE(scenario.cut.sight);
  CHECK(scenario.cut.lips == solvers::LipCondition::frictionless);
  CHECK(scenario.cut.front_spacing == 0);
  REQUIRE(scenario.blade);
  CHECK(scenario.method.cut_ahead);
  CHECK(scenario.blade->edge.size() == 2);
  CHECK(scenario.blade->edge_radius == 1e-4);
  CHECK(scenario.blade->path[0].rotation == Vector3::Zero());
  CHECK(scenario.blade->path[1].rotation == Vector3(0, 0, 90));
  CHECK(scenario.pretension.isZero());
}

TEST_CASE("Pretension is read as three normal or six components") {
  const auto with = [](const std::string& value) {
    return replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\npretension = " + value) + disc_precut;
  };
  CHECK(scenario_of(with("[0.1, 0.2, 0]")).pretension.isApprox(Matrix3(Vector3(0.1, 0.2, 0).asDiagonal())));
  Matrix3 full;
  full << 0.1, 0.03, 0.02, 0.03, 0.2, 0.01, 0.02, 0.01, 0;
  CHECK(scenario_of(with("[0.1, 0.2, 0, 0.01, 0.02, 0.03]")).pretension.isApprox(full));
  CHECK_THAT(complaint(with("[0.1, 0.2]")), Contains("material.pretension") && Contains("three or six numbers"));
  CHECK_THAT(complaint(with("[0.1, 0.2, 0.9]")), Contains("material.pretension") && Contains("<= 0.5"));
}

TEST_CASE("Toughness makes a blade that is resisted; without it there is none") {
  const std::string edge = "[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n";
  const auto tough = [](const std::string& value) {
    return replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = " + value);
  };
  CHECK(scenario_of(cut_block + edge + two_poses).toughness == 0);
  const Scenario scenario =
      scenario_of(tough("50") + edge + "sharpness = 0.8\nfriction = 30\nflank = 0.004\n" + two_poses);
  CHECK(scenario.toughness == 50);
  CHECK(scenario.blade->sharpness == 0.8);
  CHECK(scenario.blade->friction == 30);
  CHECK(scenario.blade->flank == 0.004);
  CHECK_THAT(complaint(tough("-1") + edge + two_poses), Contains("material.toughness") && Contains("<= value"));
  CHECK_THAT(complaint(tough("50") + edge + "advance = 0.5\n" + two_poses),
             Contains("blade.advance = 0.5") && Contains("allowed: one of them"));
  CHECK(scenario_of(cut_block + edge + "advance = 0.5\n" + two_poses).blade->advance == 0.5);
  CHECK_THAT(complaint(tough("50") + "[method]\nname = \"published\"\n" + edge + two_poses),
             Contains("material.toughness") && Contains("galerkin or collocation"));
}

TEST_CASE("Every offence of a cut names file, line, key, value and what is allowed") {
  struct Case {
    std::string addition;
    std::vector<std::string> expected;
  };
  const std::vector<Case> cases = {
      {"", {"no tool, no blade, no precut and no load"}},
      {"[[precut]]\nshape = \"disc\"\n", {"precut[1].centre is missing", "precut[1].radius is missing"}},
      {"[[precut]]\nshape = \"cone\"\n", {":16:", "precut[1].shape", "cone", "polygon"}},
      {replaced(disc_precut, "radius = 0.01", "radius = 0"), {":19:", "precut[1].radius", "<= value"}},
      {replaced(disc_precut, "radius = 0.01", "radius = 10.1"), {":19:", "precut[1].radius = 10.1 m: out of range"}},
      {replaced(disc_precut, "[0, 0, 0.016]", "[0.10000000000000001, 1, inf]"),
       {":17:", "precut[1].centre = [0.1, 1, inf] m"}},
      {replaced(disc_precut, "normal = [0, 0, 1]", "normal = [0, 0, 0]"), {":18:", "normal", "no direction"}},
      {replaced(disc_precut, "radius = 0.01", "radius = 0.01\nwidth = 1"), {":20:", "precut[1].width", "rectangle"}},
      {"[[precut]]\nshape = \"rectangle\"\ncentre = [0,0,0]\nnormal = [0,0,1]\nup = [0,0,3]\nwidth = 1\nheight = 1\n",
       {":19:", "up", "along the normal"}},
      {"[[precut]]\nshape = \"polygon\"\npoints = [[0,0,0], [1,0,0]]\n", {":17:", "2 corners", "three or more"}},
      {"[[precut]]\nshape = \"polygon\"\npoints = [[0,0,0], [1,0]]\n",
       {":17:", "precut[1].points[2]", "three numbers"}},
      {"[[precut]]\nshape = \"file\"\nfile = \"none.obj\"\n", {":17:", "none.obj", "no file"}},
      {"[cut]\nsight = \"blind\"\n", {":16:", "cut.sight", "diffraction"}},
      {"[cut]\nlips = \"glued\"\n", {":16:", "cut.lips", "sticking"}},
      {"[cut]\nunheld = \"lose\"\n", {":16:", "cut.unheld", "drop"}},
      {"[cut]\nfront_spacing = \"1 mm\"\n", {":16:", "cut.front_spacing", "metres"}},
      {"[blade]\n" + two_poses, {"blade.edge is missing"}},
      {"[blade]\nedge = []\n" + two_poses, {":16:", "blade.edge has 0 points", "two or more"}},
      {"[blade]\nedge = [[0, 0, 1]]\n" + two_poses, {":16:", "blade.edge has 1 point", "two or more"}},
      {"[blade]\nedge = [[0, 0, 1], [0, 0, 1]]\n" + two_poses, {":16:", "points 1 and 2", "at least 1e-06 m"}},
      {"[blade]\nedge = [[0, 0, nan], [0, 0, 1]]\n" + two_poses, {":16:", "blade.edge[1]", "nan"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n", {"blade.path is missing"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n[[blade.path]]\ntime = 0\nposition = [0, 0, 0]\n",
       {"blade.path has 1 pose", "two or more"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n" + replaced(two_poses, "time = 1", "time = 0"),
       {":21:", "blade.path[2].time = 0 s", "above 0 s"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n" + replaced(two_poses, "time = 1", "time = nan"),
       {":21:", "blade.path[2].time", "nan"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\n" + replaced(two_poses, "[0.1, 0, 0]", "[inf, 0, 0]"),
       {":22:", "blade.path[2].position", "inf"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nstep = 3\n" + two_poses, {":17:", "blade.step = 3 s", "1 s"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nedge_radius = 0\n" + two_poses, {":17:", "edge_radius", "<= value"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nsharpness = 0\n" + two_poses,
       {":17:", "sharpness", "0.001 <= value <= 1"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nsharpness = 0.5\n" + two_poses,
       {":17:", "blade.sharpness", "material.toughness"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nflank = 0.01\nfriction = 50\n" + two_poses,
       {":18:", "blade.friction", "material.toughness"}},
      {"[blade]\nedge = [[0, 0, 0], [0, 0, 1]]\nfriction = 50\n" + two_poses, {":17:", "no extent", "blade.flank"}},
  };
  for (const Case& c : cases) {
    const std::string said = complaint_about(c.addition);
    INFO(c.addition << "\nsaid: " << said);
    for (const std::string& part : c.expected)
      CHECK_THAT(said, Contains(part));
  }
}

TEST_CASE("A blade turns about one axis as far as its poses say, by the shorter way otherwise") {
  const auto path_to = [](const std::string& from, const std::string& to) {
    return scenario_of(cut_block +
                       "[blade]\nedge = [[0, 0, -0.01], [0, 0, 0.01]]\n[[blade.path]]\ntime = 0\n"
                       "position = [0, 0, 0]\nrotation = " +
                       from + "\n[[blade.path]]\ntime = 3\nposition = [0.03, 0, 0]\nrotation = " + to + "\n")
        .blade->path;
  };
  const std::vector<BladePoint> wide = path_to("[0, 0, -90]", "[0, 0, 180]");
  REQUIRE(wide.size() == 4);
  for (std::size_t k = 0; k < wide.size(); ++k) {
    CHECK(wide[k].time == Approx(static_cast<double>(k)));
    CHECK(wide[k].rotation.z() == Approx(-90 + 90 * static_cast<double>(k)).margin(1e-9));
    CHECK(wide[k].position.x() == Approx(0.01 * static_cast<double>(k)).margin(1e-12));
  }
  CHECK(path_to("[0, 0, 0]", "[0, 0, 179]").size() == 2);
  CHECK(path_to("[0, 0, 0]", "[0, 0, 360]").size() == 5);
  CHECK(path_to("[170, 0, 0]", "[0, 170, 0]").size() == 2);
}
