// A law other than linear in a hand: the body condensed onto the contact, nodes that follow tool and blade, the
// picture, the same bits twice.
#include "src/haptics/tangent_model.hpp"
#include "src/live/surface_follower.hpp"
#include "src/model/finite_model.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/device_poses.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

std::string soft(const std::string& text) {
  return replaced(text, "poisson_ratio = 0.3", "poisson_ratio = 0.49\nlaw = \"neo_hookean\"");
}

/// Pressed `depth` m into the top at x = `along`.
DeviceState pressing(std::uint64_t tick, double depth, double along = 0) {
  return device_at(tick, {along, 0, 0.03 - depth});
}

} // namespace

TEST_CASE("What the loop gets of a nonlinear body is exact where it was solved, and its tangent about it") {
  HapticSimulation simulation(scenario_of(soft(small_scenario)));
  simulation.prepare(pressing(0, -0.001));
  ContactSnapshot snapshot;
  std::uint64_t tick = 0;
  for (double depth = 0; depth < 0.0041; depth += 0.0005) // to 13 % of the thickness
    simulation.solve(pressing(++tick, depth), 0, snapshot);
  const BodyModel& model = simulation.session().model();
  REQUIRE(model.finite != nullptr);
  REQUIRE(snapshot.count > 5);
  const auto rows = 3 * static_cast<Eigen::Index>(snapshot.count);
  const Eigen::Map<const MatrixX> compliance(snapshot.condensed->compliance.data(), rows, rows);
  CHECK((compliance - compliance.transpose()).norm() < 1e-12 * compliance.norm());
  CHECK(Eigen::LLT<MatrixX>(compliance).info() == Eigen::Success);
  VectorX forces(rows), found(rows);
  for (int c = 0; c < snapshot.count; ++c) {
    forces.segment<3>(3 * c) = snapshot.forces[c];
    found.segment<3>(3 * c) = snapshot.displacement[c] - snapshot.condensed->base[c];
  }
  REQUIRE(snapshot.force.z() > 0.1);
  CHECK((compliance * forces - found).norm() < 1e-9 * found.norm());

  TangentModel tangent(simulation.tool());
  tangent.solved(snapshot);
  const Vector3 here = tangent.at(snapshot.pose, unturned, snapshot.time).force;
  CHECK((here - snapshot.force).norm() < 5e-3 * snapshot.force.norm());
  topology::ToolPose deeper = snapshot.pose, aside = snapshot.pose;
  deeper.point.z() -= 0.0002;
  aside.point.x() += 0.0005;
  for (const topology::ToolPose& pose : {deeper, aside}) {
    ModelForce expected;
    for (int round = 0; round < 10; ++round)
      expected = tangent.at(pose, unturned, snapshot.time);
    ContactSnapshot solved;
    simulation.solve(device_at(++tick, pose.point), 0, solved);
    INFO(expected.force.transpose() << " for " << solved.force.transpose());
    CHECK((expected.force - solved.force).norm() < 0.02 * solved.force.norm());
  }
}

// A tool that keeps its way: what sticks goes with it, what slips drags with the limit of the force.
TEST_CASE("What the loop gets of a nonlinear body on which a tool rubs, or to which it is bonded, is exact there") {
  for (const std::string contact : {"condition = \"bonded\"", "condition = \"frictional\"\nfriction = 0.5"}) {
    HapticSimulation simulation(scenario_of(soft(small_scenario) + "[contact]\n" + contact + "\n"));
    simulation.prepare(pressing(0, -0.001));
    ContactSnapshot snapshot;
    std::uint64_t tick = 0;
    for (double depth = 0; depth < 0.0021; depth += 0.0005)
      simulation.solve(pressing(++tick, depth), 0, snapshot);
    simulation.solve(pressing(++tick, 0.002, 0.0002), 0, snapshot); // it sticks
    REQUIRE(snapshot.count > 3);
    REQUIRE(snapshot.force.z() > 0.02);
    TangentModel tangent(simulation.tool());
    tangent.solved(snapshot);
    const Vector3 here = tangent.at(snapshot.pose, unturned, snapshot.time).force;
    INFO(contact << ": " << here.transpose() << " for " << snapshot.force.transpose());
    CHECK((here - snapshot.force).norm() < 0.01 * snapshot.force.norm());
    topology::ToolPose aside = snapshot.pose;
    aside.point.x() += 0.0002;
    ModelForce expected;
    for (int round = 0; round < 10; ++round)
      expected = tangent.at(aside, unturned, snapshot.time);
    ContactSnapshot solved;
    simulation.solve(device_at(++tick, aside.point), 0, solved);
    INFO("aside " << expected.force.transpose() << " for " << solved.force.transpose());
    CHECK(std::abs(solved.force.x()) > 0.01 * solved.force.norm());
    CHECK((expected.force - solved.force).norm() < 0.03 * solved.force.norm());
  }
}

TEST_CASE("Nodes of a nonlinear body follow a tool that slides, within the steps and in the background") {
  for (const bool in_background : {false, true}) {
    HapticSimulation simulation(scenario_of(soft(small_scenario)));
    simulation.prepare(pressing(0, -0.001));
    simulation.set_following_in_background(in_background);
    ContactSnapshot snapshot;
    std::uint64_t tick = 0;
    bool followed = false;
    double along = 0;
    for (int step = 0; step <= 30; ++step) { // then it rests, so that what is under way arrives
      along = 0.0005 * std::min(step, 24);
      if (step % 3 == 2)
        simulation.swap_body(); // waits for what is under way
      simulation.solve(pressing(++tick, 0.002, along), 0, snapshot);
      followed = followed || snapshot.resprinkled;
      CHECK(snapshot.force.z() > 0);
    }
    CHECK(followed);
    CHECK((simulation.session().zone().spacing.centres.front() - Vector3(along, 0, 0.03)).norm() < 0.0061);
    HapticSimulation fresh(
        scenario_of(replaced(soft(small_scenario), "target = [0, 0, 0.03]", "target = [0.012, 0, 0.03]")));
    fresh.prepare(pressing(0, -0.001, along));
    ContactSnapshot there;
    fresh.solve(pressing(1, 0.001, along), 0, there);
    fresh.solve(pressing(2, 0.002, along), 0, there);
    CHECK(snapshot.force.norm() == Approx(there.force.norm()).epsilon(0.06));
  }
}

TEST_CASE("The picture of a nonlinear body is that of its field") {
  HapticSimulation simulation(scenario_of(soft(small_scenario)));
  simulation.prepare(pressing(0, -0.001));
  ContactSnapshot snapshot;
  simulation.solve(pressing(1, 0.001), 0, snapshot);
  simulation.solve(pressing(2, 0.002), 0, snapshot);
  SurfaceFollower follower;
  follower.follow(simulation.session());
  std::vector<Eigen::Vector3f> vertices;
  follower.deform(simulation.session(), vertices);
  const std::vector<Vector3>& rest = simulation.session().organ().domain->surface().vertices;
  REQUIRE(vertices.size() == rest.size());
  double most = 0;
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Vector3 moved = simulation.session().model().at(rest[v]).displacement;
    most = std::max(most, moved.norm());
    CHECK((vertices[v].cast<double>() - rest[v] - moved).norm() < 1e-7);
  }
  CHECK(most > 0.0015);
}

TEST_CASE("A blade cuts a nonlinear body in the loop, with the same bits twice") {
  std::string text = soft(small_scenario);
  text = replaced(text, "[material]\n", "[material]\npretension = [0.1, 0, 0]\n") +
         blade({"[-0.02, 0.015, 0.02]", "[0.005, 0.015, 0.02]"}, 0.03, "0.1");
  text = replaced(text, "[-0.02, 0.015, 0.02]", "[0.012, 0.0, 0.036]");
  text = replaced(text, "[0.005, 0.015, 0.02]", "[0.012, 0.0, 0.022]");
  const Scenario scenario = scenario_of(text);
  const LoopRecords records = run_twice(scenario, solves_in_background(1500, 50, 20), 1500);
  double area = 0;
  for (const SolveRecord& solve : records.solves)
    area = std::max(area, solve.cut_area);
  CHECK(area > 2e-4);
  bool followed = false;
  for (const SolveRecord& solve : records.solves)
    followed = followed || solve.update == "taken over";
  CHECK(followed);
}

TEST_CASE("A viscoelastic body in a hand relaxes, and its nodes stay") {
  const std::string text =
      replaced(soft(small_scenario), "[[fixed]]", "[[material.prony]]\nshare = 0.5\ntime = 0.1\n[[fixed]]");
  HapticSimulation simulation(scenario_of(text));
  simulation.prepare(pressing(0, -0.001));
  ContactSnapshot snapshot;
  simulation.solve(pressing(1, 0.001), 0, snapshot);
  simulation.solve(pressing(2, 0.002), 0, snapshot);
  const double sudden = snapshot.force.z();
  simulation.solve(pressing(1002, 0.002), 0, snapshot);
  // Half of the shear modulus fades, the bulk modulus stays: 0.505 of E / (1 - nu^2); in the two milliseconds of the
  // press 1 to 2 % of it.
  CHECK(snapshot.force.z() == Approx(0.505 * sudden).epsilon(0.03));
  for (int step = 1; step <= 40; ++step)
    simulation.solve(pressing(1002 + step, 0.002, 0.0005 * step), 0, snapshot);
  CHECK_FALSE(snapshot.resprinkled);
  const std::vector<std::string>& warnings = simulation.session().warnings();
  CHECK(std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
    return warning.find("with material.prony they do not follow it") != std::string::npos;
  }));
}
