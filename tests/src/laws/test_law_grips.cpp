// Tools that rub on, are bonded to or hold a body whose law is not linear: against the linear run where strains are
// small, and what a grasper does to a flap.
#include "src/model/finite_model.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

std::string with_law(const std::string& text) {
  return replaced(text, "[material]\n", "[material]\nlaw = \"neo_hookean\"\n");
}

std::string block_with(const std::string& tool) {
  return replaced(small_scenario.substr(0, small_scenario.find("[tool]")), "fine_spacing = 0.004",
                  "fine_spacing = 0.0018") +
         tool + "[output]\nfigures = false\n";
}

/// A wide ball that comes down by little and goes aside, at first by less than it slips at.
const std::string pressed_aside = R"([tool]
shape = "sphere_tip"
radius = 0.1
step = 1
[[tool.path]]
time = 0
position = [0, 0, 0.0301]
[[tool.path]]
time = 1
position = [0, 0, 0.0299]
[[tool.path]]
time = 2
position = [0.00002, 0, 0.0299]
[[tool.path]]
time = 3
position = [0.0003, 0, 0.0299]
)";

const std::string rubs = "[contact]\ncondition = \"frictional\"\nfriction = 0.4\n";
const std::string bonds = "[contact]\ncondition = \"bonded\"\n";

/// A strip that is held at one end; `path`, `times`: of a grasper of its free end.
std::string strip_with(const std::string& path, const std::string& times) {
  return with_law(R"([organ]
shape = "block"
size = [0.06, 0.02, 0.006]
edge = 0.003
[material]
young_modulus = 1e4
poisson_ratio = 0.45
[[fixed]]
region = "half_space"
point = [-0.0299, 0, 0]
normal = [1, 0, 0]
[nodes]
fine_spacing = 0.004
coarse_spacing = 0.004
)") + "[tool]\nshape = \"grasper\"\nradius = 0.006\nstep = 1\n" +
         times + path + "[output]\nfigures = false\n";
}

std::string path_point(double time, const Vector3& place) {
  return fmt::format("[[tool.path]]\ntime = {}\nposition = [{}, {}, {}]\n", time, place.x(), place.y(), place.z());
}

} // namespace

TEST_CASE("At small depth a tool rubs on a neo-Hookean block, or is bonded to it, as to the linear one") {
  for (const std::string& contact : {rubs, bonds}) {
    const std::string text = block_with(pressed_aside) + contact;
    Session linear = session_of(text), finite = session_of(with_law(text));
    REQUIRE(linear.model().sprinkling.nodes.positions == finite.model().sprinkling.nodes.positions);
    const std::vector<StepResult> a = run(linear), b = run(finite);
    REQUIRE(a.size() == b.size());
    REQUIRE(a.back().active_nodes > 5);
    for (std::size_t k = 0; k < a.size(); ++k) {
      INFO(contact << "step " << k << ": " << b[k].force.transpose() << " for " << a[k].force.transpose());
      CHECK((b[k].force - a[k].force).norm() <= 0.01 * a[k].force.norm());
      CHECK((b[k].tangential - a[k].tangential).norm() <= 0.01 * a[k].force.norm());
      CHECK((b[k].torque - a[k].torque).norm() <= 0.01 * 0.01 * a[k].force.norm());
      CHECK(std::abs(b[k].active_nodes - a[k].active_nodes) <= 1);
      if (contact == rubs)
        CHECK(b[k].tangential.norm() <= 0.4 * (b[k].force - b[k].tangential).norm() * (1 + 1e-9));
    }
    CHECK(b.back().tangential.x() < -0.1 * b.back().force.z());
  }
}

TEST_CASE("At small strain a grasper draws a neo-Hookean block as it does the linear one") {
  const std::string text = block_with(R"([tool]
shape = "grasper"
radius = 0.008
step = 1
release = 3
[[tool.path]]
time = 0
position = [0, 0, 0.03]
[[tool.path]]
time = 1
position = [0, 0, 0.03002]
[[tool.path]]
time = 2
position = [0.00002, 0.00001, 0.03003]
[[tool.path]]
time = 3
position = [0.00002, 0, 0.03]
)");
  Session linear = session_of(text), finite = session_of(with_law(text));
  const std::vector<StepResult> a = run(linear), b = run(finite);
  REQUIRE(a.size() == 4);
  REQUIRE(b.size() == 4);
  CHECK(b[0].force.norm() < 1e-6 * a[1].force.norm());
  for (const std::size_t k : {1, 2}) {
    INFO("step " << k << ": " << b[k].force.transpose() << " for " << a[k].force.transpose());
    CHECK((b[k].force - a[k].force).norm() < 0.01 * a[k].force.norm());
    CHECK((b[k].torque - a[k].torque).norm() < 0.01 * 0.008 * a[k].force.norm()); // about the grasper's point
    CHECK(b[k].active_nodes == a[k].active_nodes);
    CHECK(b[k].candidates == a[k].candidates);
    CHECK(b[k].contact_radius == Approx(a[k].contact_radius).epsilon(0.05));
  }
  CHECK(b[3].force.norm() == 0);
  CHECK(b[3].active_nodes == 0);
  CHECK_FALSE(finite.grasps());
  CHECK(finite.model().at({0, 0, 0.03}).displacement.norm() < 1e-8);
}

TEST_CASE("A grasper bends a strip of a law round and lets it go back to rest") {
  std::string path;
  const Vector3 clear(0.027, 0, 0.006);
  for (int k = 0; k <= 12; ++k) {
    const double angle = std::numbers::pi / 2 * k / 12, length = 0.057;
    const double radius = k > 0 ? length / angle : 0;
    path += path_point(
        k, k == 0 ? clear : Vector3(-0.03 + radius * std::sin(angle), 0, 0.006 + radius * (1 - std::cos(angle))));
  }
  path += path_point(13, {0.01, 0, 0.05});
  Session session = session_of(strip_with(path, "release = 12.5\n"));
  const std::vector<StepResult> steps = run(session);
  REQUIRE(steps.size() == 14);
  double force = 0;
  for (std::size_t k = 1; k <= 12; ++k) {
    CHECK(steps[k].active_nodes > 5);
    CHECK(steps[k].residual < 1e-4);
    CHECK(steps[k].force.norm() > force);
    force = steps[k].force.norm();
    CHECK(steps[k].largest_penetration == 0);
  }
  CHECK(steps[12].rotation_degrees > 70); // the patch keeps its attitude
  CHECK(steps[12].least_jacobian > 0.5);
  CHECK(steps[13].force.norm() == 0);
  CHECK(steps[13].rotation_degrees < 0.1);
  for (const Vector3& x : {Vector3(0.03, 0.01, 0.006), Vector3(0.027, 0, 0.006)})
    CHECK(session.model().at(x).displacement.norm() < 2e-5);
  CHECK(session.warnings().empty());
}

TEST_CASE("A grasper that holds a block of a law goes on holding what a blade leaves it") {
  const std::string text = with_law(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.45")) + R"([tool]
shape = "grasper"
radius = 0.008
step = 0.25
[[tool.path]]
time = 0
position = [0.02, 0, 0.03]
[[tool.path]]
time = 1
position = [0.02, 0, 0.034]
[[tool.path]]
time = 2
position = [0.02, 0, 0.034]
[blade]
edge = [[0, 0, -0.008], [0, 0, 0.02]]
step = 0.25
[[blade.path]]
time = 1
position = [0.006, -0.04, 0.025]
[[blade.path]]
time = 2
position = [0.006, 0.0, 0.025]
)";
  Session session = session_of(text);
  const std::vector<StepResult> steps = run(session);
  double before = 0, after = 0;
  for (const StepResult& step : steps) {
    CHECK_FALSE(step.cut->refused);
    (step.time < 1.01 ? before : after) = step.force.z();
  }
  CHECK(session.grasps());
  CHECK(steps.back().cut->area > 3e-4);
  CHECK(before < 0);
  CHECK(after == Approx(before).epsilon(0.05)); // other nodes, and a cut that does not reach it
  CHECK(steps.back().active_nodes == steps.front().active_nodes);
  // The patch is where it was held.
  CHECK((session.model().at({0.02, 0, 0.03}).displacement - Vector3(0, 0, 0.004)).norm() < 6e-4);
  // So it does in a hand.
  Session in_hand(
      scenario_of(text), [](const std::string&) {}, Leader::device);
  SessionOptions options = in_hand.options();
  options.grip = true;
  in_hand.set_options(options);
  double held = 0;
  for (const StepSample& sample : session.steps())
    held = in_hand.step(sample).force.z();
  CHECK(in_hand.grasps());
  CHECK(held == Approx(after).epsilon(0.02));
}

TEST_CASE("A blade does not cut where a tool rubs on a body of a law, or is bonded to it") {
  const std::string text = with_law(cut_block) + R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[[tool.path]]
time = 0
position = [0, 0, 0.031]
[[tool.path]]
time = 1
position = [0, 0, 0.028]
[[tool.path]]
time = 2
position = [0.001, 0, 0.028]
[blade]
edge = [[0, 0, -0.008], [0, 0, 0.02]]
step = 0.25
[[blade.path]]
time = 1
position = [0.001, -0.04, 0.025]
[[blade.path]]
time = 2
position = [0.001, 0.0, 0.025]
)";
  for (const bool bonded : {false, true}) {
    Session session = session_of(text + (bonded ? bonds : rubs));
    int refused = 0;
    for (const StepResult& step : run(session))
      refused += step.cut->refused;
    CHECK(refused > 0);
    REQUIRE_FALSE(session.warnings().empty());
    CHECK_THAT(session.warnings().front(),
               Catch::Contains(bonded ? "the tool sticks to the tissue" : "the blade cuts where the tool is pressing"));
  }
}
