#include "src/session/session.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

std::string with_motion(const std::string& motion) {
  const auto from = small_scenario.find("[tool.approach]");
  return small_scenario.substr(0, from) + motion + small_scenario.substr(small_scenario.find("[output]"));
}

std::string path(const std::vector<std::pair<double, std::string>>& poses) {
  std::string text;
  for (const auto& [time, position] : poses)
    text += "[[tool.path]]\ntime = " + std::to_string(time) + "\nposition = " + position + "\n";
  return with_motion(text);
}

} // namespace

TEST_CASE("An approach starts its clearance above the first touch and ends its depth below") {
  Session session = session_of(small_scenario);
  REQUIRE(session.steps().size() == 5);
  CHECK(session.steps().front().tool->point.isApprox(Vector3(0, 0, 0.031), 1e-6));
  CHECK(session.steps().back().tool->point.isApprox(Vector3(0, 0, 0.028), 1e-6));
  CHECK(session.touches());
}

TEST_CASE(
    "A ball pressed into a block feels a force that rises as Hertz says, along its axis, and the base carries it") {
  Session session = session_of(small_scenario);
  const std::vector<StepResult> steps = run(session);
  CHECK(steps.front().force.norm() == 0);
  CHECK(steps[1].force.norm() == 0);
  CHECK(steps[2].force.z() > 0);
  CHECK(steps[3].force.z() > steps[2].force.z());
  const StepResult& last = steps.back();
  CHECK(last.force.head<2>().norm() < 0.05 * last.force.z());
  // Half-space of the same material: (4/3) E/(1 - nu^2) sqrt(R) d^(3/2) = 0.131 N. The block is three times as thick as
  // the ball's radius and held at its base, hence stiffer; its nodes are coarse.
  CHECK(last.force.z() > 0.85 * 0.131);
  CHECK(last.force.z() < 1.6 * 0.131);
  Vector3 carried = Vector3::Zero();
  for (const Vector3& force : session.model().body->constraint_forces(session.model().field))
    carried += force;
  CHECK((carried - last.force).norm() < 1e-8 * last.force.norm());
  CHECK(last.residual < 1e-9);
  CHECK(last.contact.depth == Approx(0.002).margin(1e-6));
  CHECK(last.converged);
}

TEST_CASE("The same scenario gives the same bits") {
  Session a = session_of(small_scenario);
  Session b = session_of(small_scenario);
  CHECK(run(a).back().force == run(b).back().force);
}

TEST_CASE("A motion that never touches gives zero force and says so") {
  Session session = session_of(path({{0, "[0, 0, 0.04]"}, {1, "[0.01, 0, 0.04]"}}));
  CHECK_FALSE(session.touches());
  for (const StepResult& step : run(session))
    CHECK(step.force.norm() == 0);
  REQUIRE(session.warnings().size() == 1);
  CHECK_THAT(session.warnings().front(), Contains("never touches"));
}

TEST_CASE("An approach that goes through the organ is told before the run, with the thickness there") {
  const std::string deep = "depth = 0.002";
  CHECK(session_of(replaced(small_scenario, deep, "depth = 0.029")).warnings().empty());
  const Session session = session_of(replaced(small_scenario, deep, "depth = 0.031"));
  REQUIRE(session.warnings().size() == 1);
  CHECK_THAT(session.warnings().front(),
             Contains("tool.approach.depth = 0.031 m, but at [0, 0, 0.03] m") && Contains("0.03 m thick"));
}

TEST_CASE("A tool that lifts off again ends without force") {
  Session session = session_of(path({{0, "[0, 0, 0.031]"}, {0.5, "[0, 0, 0.029]"}, {1, "[0, 0, 0.032]"}}));
  const std::vector<StepResult> steps = run(session);
  CHECK(steps[2].force.z() > 0);
  CHECK(steps.back().force.norm() == 0);
}

TEST_CASE("A tool that starts inside the organ is refused") {
  CHECK_THROWS_WITH(
      session_of(path({{0, "[0, 0, 0.02]"}, {1, "[0, 0, 0.01]"}})),
      Contains("case.toml:24: tool.path[1].position = [0, 0, 0.02] m: the tool starts inside the organ, "));
  // Swallowed whole: the surface is nowhere near the ball.
  CHECK_THROWS_WITH(
      session_of(replaced(path({{0, "[0, 0, 0.012]"}, {1, "[0, 0, 0.01]"}}), "radius = 0.01\n", "radius = 0.001\n")),
      Contains("starts inside"));
}

TEST_CASE("A fixed region without nodes is refused with its name and line") {
  const std::string text = replaced(small_scenario, "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                                    "lower = [-1, -1, -0.2]\nupper = [1, 1, -0.1]");
  CHECK_THROWS_WITH(session_of(text), Contains("case.toml:9") && Contains("'base'") && Contains("no surface node"));
}

TEST_CASE("Where regions hold nothing, no piece of a precut organ is called severed before that is said") {
  const std::string text = replaced(cut_block, "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                                    "lower = [-1, -1, -2]\nupper = [1, 1, -1]") +
                           disc_precut + "[cut]\nunheld = ";
  for (const std::string unheld : {"\"hold\"", "\"drop\"", "\"refuse\""}) {
    std::string said;
    CHECK_THROWS_WITH(Session(scenario_of(text + unheld), [&](const std::string& line) { said += line; }),
                      Contains("no surface node") && !Contains("severed"));
    CHECK(said.find("severed") == std::string::npos);
  }
}

TEST_CASE("Too few nodes are refused with the limit") {
  const std::string text = replaced(replaced(small_scenario, "fine_spacing = 0.004", "fine_spacing = 0.5"),
                                    "coarse_spacing = 0.012", "coarse_spacing = 0.5");
  CHECK_THROWS_AS(session_of(text), InputError);
}

TEST_CASE("The fine zone follows a sliding tool and the force hardly jumps, with friction as without") {
  const auto condition = GENERATE(as<std::string>(), "frictionless", "frictional");
  const std::string text =
      replaced(path({{0, "[-0.008, 0, 0.031]"}, {0.5, "[-0.008, 0, 0.0285]"}, {1.5, "[0.008, 0, 0.0285]"}}),
               "fine_spacing = 0.004", "fine_spacing = 0.0028") +
      "[contact]\ncondition = \"" + condition + "\"\n";
  Session session = session_of(text);
  int followed = 0;
  for (const StepResult& step : run(session)) {
    followed += step.resprinkled ? 1 : 0;
    if (condition == "frictionless")
      CHECK(step.tangential.isZero(0));
    CHECK(step.force_jump < 0.1); // coarse nodes: half a spacing of the contact's edge is 10 % of the force
    if (condition == "frictional" &&
        step.time > 1) { // it slips: friction is 0.3 of the pressure, and goes on at a re-sprinkle
      INFO("t = " << step.time << " s, resprinkled " << step.resprinkled);
      CHECK(-step.force.x() / step.force.z() == Approx(0.3).margin(0.06)); // and the slope of the dent
      const Vector3 normal = step.force - step.tangential;
      CHECK(step.tangential.norm() / normal.norm() == Approx(0.3).margin(0.02)); // the directions differ by node
      CHECK(std::abs(normal.x()) < 0.2 * std::abs(step.tangential.x()));
    }
  }
  CHECK(followed >= 2);
}

TEST_CASE("The force of a bonded ball is parted by the surface at rest") {
  Session session = session_of(path({{0, "[0, 0, 0.031]"}, {0.5, "[0, 0, 0.0285]"}, {1, "[0.001, 0, 0.0285]"}}) +
                               "[contact]\ncondition = \"bonded\"\n");
  const std::vector<StepResult> steps = run(session);
  const StepResult& last = steps.back();
  CHECK(last.force.x() < -0.001); // the tissue holds the ball back
  CHECK(last.tangential.x() == Approx(last.force.x()));
  CHECK(std::abs(last.tangential.z()) < 1e-9 * last.force.norm());
}

TEST_CASE("A deep tip between nodes too coarse for it is told") {
  const std::string fine = path({{0, "[0, 0, 0.031]"}, {1, "[0, 0, 0.0265]"}});
  Session good = session_of(fine);
  run(good);
  const auto told = [](const Session& session) {
    std::string all;
    for (const std::string& warning : session.warnings())
      all += warning + "\n";
    return all;
  };
  CHECK_THAT(told(good), !Contains("too coarse"));
  Session coarse = session_of(replaced(replaced(fine, "fine_spacing = 0.004", "fine_spacing = 0.02"),
                                       "coarse_spacing = 0.012", "coarse_spacing = 0.02"));
  run(coarse);
  CHECK_THAT(told(coarse), Contains("too coarse for a tip of 0.01 m") && Contains("nodes.fine_spacing"));
}

TEST_CASE("A tool and a blade come to the corners of their ways, whatever the step") {
  const auto comes_to = [](const Session& session, const Vector3& place, double time) {
    return std::any_of(session.steps().begin(), session.steps().end(), [&](const StepSample& sample) {
      const Vector3 at = sample.tool ? sample.tool->point : sample.blade->position;
      return std::abs(sample.time - time) < 1e-9 && (at - place).norm() < 1e-9;
    });
  };
  const Session pressed = session_of(path({{0, "[0, 0, 0.032]"}, {0.37, "[0, 0, 0.028]"}, {1, "[0, 0, 0.032]"}}));
  CHECK(comes_to(pressed, {0, 0, 0.028}, 0.37));
  CHECK(comes_to(pressed, {0, 0, 0.032}, 1));
  const Session cut = session_of(cut_block + R"([blade]
edge = [[0, -0.006, 0], [0, 0.006, 0]]
step = 0.25
[[blade.path]]
time = 0
position = [0, 0, 0.033]
[[blade.path]]
time = 0.4
position = [0, 0, 0.02]
[[blade.path]]
time = 1
position = [0, 0, 0.033]
)");
  CHECK(comes_to(cut, {0, 0, 0.02}, 0.4));
  REQUIRE(cut.steps().size() == 6); // 0, 0.25, 0.4, 0.5, 0.75, 1
}

TEST_CASE("What is bonded to a tool stays so when the tool comes to more nodes than were candidates") {
  const std::string drag =
      path({{0, "[0, 0, 0.0305]"}, {1, "[0, 0, 0.0285]"}, {3, "[0.004, 0, 0.0285]"}, {4, "[0.006, 0, 0.025]"}});
  const auto last_force = [&](const std::string& candidates) {
    Session session = session_of(drag + "[contact]\ncondition = \"bonded\"\ncandidate_radius = " + candidates + "\n");
    return run(session).back().force;
  };
  const Vector3 few = last_force("0.005"), many = last_force("0.03");
  CHECK(many.x() < -0.3);
  CHECK((few - many).norm() < 0.02 * many.norm());
}

TEST_CASE("Gravity alone bends the organ by its weight") {
  Session session = session_of(small_scenario + "[gravity]\nacceleration = [0, 0, -9.81]\n");
  const StepResult first = session.step(session.steps().front());
  static_cast<void>(first);
  Vector3 carried = Vector3::Zero();
  for (const Vector3& force : session.model().body->constraint_forces(session.model().field))
    carried += force;
  const double weight = 1060 * 9.81 * 0.06 * 0.06 * 0.03;
  CHECK(carried.z() == Approx(weight).epsilon(2e-3));
}

TEST_CASE("The wanted number of nodes is about reached") {
  const Session session = session_of(replaced(small_scenario, "fine_radius = 0.006", "count = 300"));
  CHECK(session.model().sprinkling.nodes.size() == Approx(300).epsilon(0.15));
}
