// Runs whose law is not linear: against the linear run where strains are small, against closed forms where they are
// large, what they refuse, and their bits against threads.
#include "solvers/algebra/parallel.hpp"
#include "solvers/elasticity/homogeneous.hpp"
#include "solvers/elasticity/rotation.hpp"
#include "src/model/finite_model.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

const std::string law = "law = \"neo_hookean\"\n";

std::string with_law(const std::string& text) {
  return replaced(text, "[material]\n", "[material]\n" + law);
}

/// A cube of 20 mm on rollers at its base, its sides free or on rollers too, under a punch wider than it.
std::string pressed_cube(bool confined, double depth) {
  std::string text = fmt::format(R"([organ]
shape = "block"
size = [0.02, 0.02, 0.02]
edge = 0.004
[material]
young_modulus = 1e4
poisson_ratio = 0.3
[[fixed]]
region = "half_space"
point = [0, 0, 1e-6]
normal = [0, 0, 1]
axes = ["z"]
[nodes]
fine_spacing = 0.004
coarse_spacing = 0.004
[tool]
shape = "flat_punch"
radius = 0.03
step = 0.25
[tool.approach]
target = [0, 0, 0.02]
direction = [0, 0, -1]
depth = {}
clearance = 0.0005
[output]
figures = false
)",
                                 depth);
  for (const double side : {-1.0, 1.0})
    for (const int axis : {0, 1})
      if (confined || side < 0)
        text += fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [{0}, {1}, 0]\nnormal = [{2}, {3}, "
                            "0]\naxes = [\"{4}\"]\n",
                            axis == 0 ? side * 0.009999 : 0, axis == 1 ? side * 0.009999 : 0, axis == 0 ? -side : 0,
                            axis == 1 ? -side : 0, axis == 0 ? "x" : "y");
  return text;
}

/// A ball that goes down into the middle of the block's top, and up again on the same way.
const std::string there_and_back = R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[[tool.path]]
time = 0
position = [0, 0, 0.031]
[[tool.path]]
time = 1
position = [0, 0, 0.026]
[[tool.path]]
time = 2
position = [0, 0, 0.031]
)";

/// The last row of a table, by the names of its columns.
std::map<std::string, double> last_row(const std::string& table) {
  std::istringstream lines(table);
  std::string names, line, last, name, value;
  std::getline(lines, names);
  while (std::getline(lines, line))
    last = line;
  std::istringstream head(names), row(last);
  std::map<std::string, double> result;
  while (std::getline(head, name, ',') && std::getline(row, value, ','))
    result[name] = std::stod(value);
  return result;
}

StepResult last_of(const std::string& text) {
  Session session = session_of(text);
  return run(session).back();
}

} // namespace

TEST_CASE("At small depth a neo-Hookean block resists a ball as the linear one does, on the same nodes") {
  // A wide ball and fine nodes: several of them touch. Gradients and quadrature differ from those of the linear body.
  const std::string text = replaced(replaced(replaced(small_scenario, "depth = 0.002", "depth = 0.0001"),
                                             "fine_spacing = 0.004", "fine_spacing = 0.002"),
                                    "radius = 0.01\nstep", "radius = 0.1\nstep");
  Session linear = session_of(text), finite = session_of(with_law(text));
  REQUIRE(linear.model().sprinkling.nodes.positions == finite.model().sprinkling.nodes.positions);
  const StepResult a = run(linear).back(), b = run(finite).back();
  REQUIRE(a.force.z() > 0);
  CHECK(b.force.z() == Approx(a.force.z()).epsilon(0.01));
  CHECK(a.active_nodes > 5);
  CHECK(b.active_nodes == a.active_nodes);
  CHECK(b.residual < 1e-4);
  CHECK(b.least_jacobian < 1);
  CHECK(finite.warnings().empty());
  // Displacement and stress under the tip.
  const Vector3 below(0, 0, 0.026);
  CHECK((finite.model().at(below).displacement - linear.model().at(below).displacement).norm() <
        0.02 * linear.model().at(below).displacement.norm());
}

TEST_CASE("A cube pressed by a quarter has the force of the closed form, the linear law does not") {
  const solvers::LawSpec spec = scenario_of(with_law(pressed_cube(true, 0.005))).law.spec;
  for (const bool confined : {true, false}) {
    INFO((confined ? "confined" : "free"));
    const std::string text = pressed_cube(confined, 0.005);
    const solvers::homogeneous::State state =
        confined ? solvers::homogeneous::confined(spec, 0.75) : solvers::homogeneous::uniaxial(spec, 0.75);
    const double exact = -state.stress(0, 0) * 0.02 * 0.02;
    const StepResult finite = last_of(with_law(text));
    CHECK(finite.force.z() == Approx(exact).epsilon(0.02));
    CHECK(finite.least_jacobian == Approx(state.gradient.determinant()).epsilon(0.02));
    CHECK(std::abs(last_of(text).force.z() / exact - 1) > 0.08);
  }
}

TEST_CASE("The program's table has the force of the closed form at 30 % of compression") {
  const TemporaryFolder folder;
  for (const bool confined : {true, false}) {
    const std::string text = with_law(pressed_cube(confined, 0.006)), name = confined ? "confined" : "free";
    const std::filesystem::path file = write_file(folder.path() / (name + ".toml"), text);
    const ProgramResult result = run_spherecut({"run", file.string(), "--out", (folder.path() / name).string()});
    INFO(name << ": " << result.out << result.err);
    REQUIRE(result.status == 0);
    const solvers::LawSpec spec = scenario_of(text).law.spec;
    const solvers::homogeneous::State state =
        confined ? solvers::homogeneous::confined(spec, 0.7) : solvers::homogeneous::uniaxial(spec, 0.7);
    std::map<std::string, double> row = last_row(read_file(folder.path() / name / "forces.csv"));
    CHECK(row.at("depth_m") == Approx(0.006));
    CHECK(row.at("force_z_N") == Approx(-state.stress(0, 0) * 0.02 * 0.02).epsilon(0.01));
    CHECK(row.at("least_jacobian") == Approx(state.gradient.determinant()).epsilon(0.02));
  }
}

TEST_CASE("A block of a law gives back what a tool does to it: the way up is the way down") {
  const std::string block = small_scenario.substr(0, small_scenario.find("[tool]"));
  Session session = session_of(with_law(block + there_and_back));
  const std::vector<StepResult> steps = run(session);
  REQUIRE(steps.size() == 9);
  const double most = steps[4].force.z();
  CHECK(most > 0);
  for (std::size_t k = 1; k < 4; ++k) {
    CHECK(steps[8 - k].force.z() == Approx(steps[k].force.z()).margin(1e-3 * most));
    CHECK(steps[8 - k].active_nodes == steps[k].active_nodes);
  }
  CHECK(steps.back().force.norm() == 0);
  CHECK(session.model().at({0, 0, 0.03}).displacement.norm() < 1e-3 * 0.004);
}

TEST_CASE("The angle of a deformation is that of its rotation, whatever the stretch") {
  const Matrix3 stretch = Vector3(0.6, 1.1, 1.7).asDiagonal();
  for (const double degrees : {0.0, 1e-3, 30.0, 90.0, 179.0}) {
    const Eigen::AngleAxisd turn(degrees * std::numbers::pi / 180, Vector3(1, 2, -2).normalized());
    CHECK(solvers::rotation_degrees(turn.toRotationMatrix() * stretch) == Approx(degrees).margin(1e-9));
  }
}

TEST_CASE("A neo-Hookean block hangs by its weight from the tool's way on") {
  const std::string text =
      replaced(with_law(small_scenario), "poisson_ratio = 0.3\n", "poisson_ratio = 0.3\ndensity = 1000\n") +
      "[gravity]\nacceleration = [0, 0, -9.81]\n";
  Session session = session_of(text);
  const std::vector<StepResult> results = run(session);
  const Vector3 top(0.02, 0.02, 0.03);
  CHECK(session.model().at(top).displacement.z() < 0);
  CHECK(results.front().force.norm() == 0); // the way counts from the sagged surface
  CHECK(results.back().force.z() > 0);
}

TEST_CASE("What a law other than linear does not go with is refused with its line") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& what) {
    const std::filesystem::path file = write_file(folder.path() / "law.toml", text), out = folder.path() / "out";
    const ProgramResult result = run_spherecut({"run", file.string(), "--out", out.string()});
    INFO(result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, Contains("law.toml:") &&
                               Contains(what + " does not go with material.law = \"neo_hookean\"; possible with it: "));
    CHECK_FALSE(std::filesystem::exists(out));
    const ProgramResult check = run_spherecut({"check", file.string()});
    CHECK(check.status == 2);
    CHECK(check.err == result.err);
    CHECK_THAT(check.out, !Contains("good"));
  };
  const std::string small = with_law(small_scenario), block = with_law(cut_block);
  refused(small + "[method]\nname = \"collocation\"\n", "method.name = \"collocation\"");
  refused(replaced(block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 100") + incision_at_end +
              "[tearing]\n",
          "[blade] with material.toughness and [tearing]");
  refused(block + disc_precut + "[cut]\nlips = \"sticking\"\n", "cut.lips = \"sticking\"");
  refused(replaced(block, "poisson_ratio = 0.3\n", "poisson_ratio = 0.3\n[[material.prony]]\nshare = 0.3\ntime = 2\n") +
              incision_at_end,
          "[blade] with material.prony");
  CHECK_THROWS_WITH(
      Session(
          scenario_of(small + "[method]\nname = \"collocation\"\n"), [](const std::string&) {}, Leader::device),
      Contains("method.name = \"collocation\" does not go with material.law = \"neo_hookean\""));
}

TEST_CASE("A load without equilibrium is told by its key, not by the steps of a tool that is not there") {
  const auto told = [](const std::string& text) -> std::string { // a hand gives up soon
    try {
      Session session(
          scenario_of(text), [](const std::string&) {}, Leader::device);
      session.step(session.steps().front());
    } catch (const NumericalError& error) {
      return error.what();
    }
    return "";
  };
  const std::string block = with_law(replaced(cut_block, "fine_spacing = 0.005", "fine_spacing = 0.008"));
  CHECK_THAT(told(block + disc_precut + "pressure = 1e7\n"),
             Contains("The body is driven by precut[1].pressure = 1e+07 Pa. A load acts whole at once: ") &&
                 Contains("cut.front_spacing") && !Contains("tool"));
  const std::string heavy =
      replaced(with_law(small_scenario), "poisson_ratio = 0.3\n", "poisson_ratio = 0.3\ndensity = 20000\n") +
      "[gravity]\nacceleration = [0, 0, -90]\n";
  CHECK_THAT(told(heavy), Contains("The body is driven by gravity.acceleration") && !Contains("tool.step"));
}

TEST_CASE("A piece that nothing holds is refused with a law by the keys that hold it") {
  const TemporaryFolder folder;
  const std::string parted =
      with_law(cut_block) + rectangle_precut("[0, 0, 0.016]", "[0, 0, 1]", "[1, 0, 0]", "0.1", "0.1");
  const std::filesystem::path file = write_file(folder.path() / "law.toml", parted);
  for (const ProgramResult& result : {run_spherecut({"run", file.string(), "--out", (folder.path() / "out").string()}),
                                      run_spherecut({"check", file.string()})}) {
    CHECK(result.status == 2);
    CHECK_THAT(result.err,
               Contains("1 of 2 pieces") && Contains("whatever cut.unheld says: ") &&
                   Contains("A region of [[fixed]] that holds it does, or a cut (precut) that ends before"));
    CHECK_THAT(result.out, !Contains("good"));
  }
  CHECK_FALSE(std::filesystem::exists(folder.path() / "out"));
}

TEST_CASE("A confined cube that is held pressed relaxes as its Prony series") {
  const std::string cube = replaced(with_law(pressed_cube(true, 0.004)), "[[fixed]]",
                                    "[[material.prony]]\nshare = 0.5\ntime = 2\n[[fixed]]");
  const auto at = cube.find("[tool.approach]"), end = cube.find("[output]");
  const std::string text = cube.substr(0, at) + R"([[tool.path]]
time = 0
position = [0, 0, 0.0201]
[[tool.path]]
time = 0.001
position = [0, 0, 0.016]
[[tool.path]]
time = 4
position = [0, 0, 0.016]
)" + cube.substr(end);
  Session session = session_of(replaced(text, "step = 0.25", "step = 0.5"));
  const std::vector<StepResult> steps = run(session);
  solvers::LawSpec spec = scenario_of(text).law.spec;
  spec.prony.clear();
  const std::unique_ptr<solvers::Law> law = solvers::make_law(spec);
  Matrix3 f = Matrix3::Identity(), all, shape;
  f(2, 2) = 0.8;
  double energy = 0;
  law->evaluate({&f, 1}, {}, {&energy, 1}, {&all, 1});
  law->evaluate_isochoric({&f, 1}, {}, {&energy, 1}, {&shape, 1});
  int seen = 0;
  for (const StepResult& step : steps)
    if (step.time >= 0.001) {
      const double left = 0.5 + 0.5 * std::exp(-(step.time - 0.001) / 2);
      CHECK(step.force.z() == Approx(-(all - shape + left * shape)(2, 2) * 4e-4).epsilon(0.02));
      ++seen;
    }
  CHECK(seen > 5);
  CHECK(steps.back().force.z() < 0.95 * steps[1].force.z());
}

TEST_CASE("At small pre-tension a cut opens as that of the linear law, at a large one it does not") {
  // Held at two opposite sides, drawn between them, cut across from the top.
  const auto text = [](double pretension) {
    return replaced(replaced(cut_block, "poisson_ratio = 0.3",
                             fmt::format("poisson_ratio = 0.3\npretension = [{}, 0, 0]", pretension)),
                    R"(region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
)",
                    R"(region = "half_space"
point = [-0.0299, 0, 0]
normal = [1, 0, 0]
[[fixed]]
region = "half_space"
point = [0.0299, 0, 0]
normal = [-1, 0, 0]
)") + rectangle_precut("[0.001, 0, 0.03]", "[1, 0, 0]", "[0, 0, 1]", "0.08", "0.03");
  };
  const auto opening = [](const std::string& scenario) {
    Session session = session_of(scenario);
    const StepResult step = run(session).back();
    CHECK(step.cut->pieces == 1);
    return std::pair(step.cut->opening, step.cut->opening_volume);
  };
  const auto linear = opening(text(0.002)), finite = opening(with_law(text(0.002)));
  REQUIRE(linear.first > 1e-5);
  CHECK(finite.first == Approx(linear.first).epsilon(0.03));
  CHECK(finite.second == Approx(linear.second).epsilon(0.03));
  // The nominal stress of a neo-Hookean body rises less than its strain, and the tissue thins.
  const auto drawn = opening(with_law(text(0.3)));
  CHECK(drawn.second / finite.second > 100);
  CHECK(std::abs(drawn.second / (150 * linear.second) - 1) > 0.05);
}

TEST_CASE("A blade's cut in pre-tensioned tissue of a law opens as the same cut that was there before") {
  const std::string block =
      replaced(replaced(with_law(cut_block), "poisson_ratio = 0.3", "poisson_ratio = 0.45\npretension = [0.0, 0.2, 0]"),
               R"(region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
)",
               R"(region = "half_space"
point = [0, -0.0299, 0]
normal = [0, 1, 0]
[[fixed]]
region = "half_space"
point = [0, 0.0299, 0]
normal = [0, -1, 0]
)");
  Session grown = session_of(replaced(block, node_spacings("0.005", "0.012"), node_spacings("0.004", "0.008")) +
                             R"([blade]
edge = [[0, 0, 0], [0, 0, 0.03]]
step = 0.1
[[blade.path]]
time = 0
position = [-0.04, 0.0005, 0.018]
[[blade.path]]
time = 1
position = [0.0, 0.0005, 0.018]
)");
  const std::vector<StepResult> steps = run(grown);
  double volume = 0;
  for (const StepResult& step : steps) {
    REQUIRE_FALSE(step.cut->refused);
    CHECK(step.cut->opening_volume >= volume); // it only opens on
    volume = step.cut->opening_volume;
  }
  CHECK(steps.back().cut->area > 3e-4);
  CHECK(steps.back().cut->opening > 5e-4);
  CHECK(std::count_if(steps.begin(), steps.end(),
                      [](const StepResult& step) { return step.cut->update == SystemUpdate::rebuilt; }) > 4);
  CHECK(steps.back().least_jacobian > 0.5);
}

TEST_CASE("Lips of a law are pressed together and do not go through each other") {
  // A slanted cut below the ball.
  const std::string cut = rectangle_precut("[0, 0, 0.022]", "[0.3, 0, 1]", "[1, 0, -0.3]", "0.03", "0.03");
  const std::string text = with_law(replaced(small_scenario, "depth = 0.002", "depth = 0.004")) + cut;
  Session closed = session_of(text), open = session_of(text + "[cut]\nlips = \"open\"\n");
  const StepResult held = run(closed).back(), free = run(open).back();
  const auto overlap = [](const Session& session) {
    double least = 0;
    for (const double opening : session.model().finite->openings())
      least = std::min(least, opening);
    return -least;
  };
  CHECK(held.cut->closed_pairs > 0);
  CHECK(overlap(closed) < 2e-3 * 0.004);
  CHECK(overlap(open) > 0.02 * 0.004);
  CHECK(held.force.z() > 1.02 * free.force.z()); // what is above the cut rests on what is below
}

TEST_CASE("A run of a law has the same bits with one thread and with two") {
  const std::string text = with_law(small_scenario);
  const int before = solvers::thread_count();
  std::vector<Vector3> forces[2];
  for (const int threads : {1, 2}) {
    solvers::set_thread_count(threads);
    Session session = session_of(text);
    for (const StepResult& step : run(session))
      forces[threads - 1].push_back(step.force);
  }
  solvers::set_thread_count(before);
  CHECK(forces[0].back().norm() > 0);
  CHECK(forces[0] == forces[1]);
}

TEST_CASE("A run tells iterations and the least volume ratio; one that finds no equilibrium keeps its rows") {
  const TemporaryFolder folder;
  const auto run_of = [&](const std::string& text, const std::string& name) {
    const std::filesystem::path file = write_file(folder.path() / (name + ".toml"), text);
    return run_spherecut({"run", file.string(), "--out", (folder.path() / name).string()});
  };
  const ProgramResult good = run_of(with_law(small_scenario), "good");
  CHECK(good.status == 0);
  CHECK_THAT(good.out, Contains("law neo_hookean") && Contains("(1 at rest; sound from 0.3 on)") &&
                           !Contains("the least volume ratio is"));
  const auto summary = nlohmann::json::parse(read_file(folder.path() / "good/summary.json"));
  const auto& found = summary["solver"]["finite_strain"];
  CHECK(found["law"] == "neo_hookean");
  CHECK(found["median_iterations"] > 0);
  CHECK(found["least_jacobian"] < 1);
  CHECK_THAT(read_file(folder.path() / "good/forces.csv"), Contains("torque_Nm,least_jacobian\n"));

  // A confined cube is pressed flat: no state is left.
  const ProgramResult bad = run_of(replaced(with_law(pressed_cube(true, 0.0199)), node_spacings("0.004", "0.004"),
                                            node_spacings("0.0065", "0.0065")),
                                   "bad");
  CHECK(bad.status == 3);
  CHECK_THAT(bad.err, Contains("no equilibrium found: "));
  const auto failed = nlohmann::json::parse(read_file(folder.path() / "bad/summary.json"));
  CHECK(failed["status"] == "failed");
  CHECK_THAT(bad.out, Contains("warning: the least volume ratio is 0.26 at t = 0.75 s (sound from 0.3 on)"));
  const int done = failed["steps"]["done"];
  CHECK(done > 0);
  const std::string rows = read_file(folder.path() / "bad/forces.csv");
  CHECK(std::count(rows.begin(), rows.end(), '\n') == done + 1);
}
