// A blade in the hand: its force between solves, continuity while it indents and cuts, and a device's stiffness.
#include "src/haptics/blade_model.hpp"
#include "src/haptics/tick.hpp"
#include "src/live/haptic_report.hpp"
#include "src/live/virtual_loop.hpp"

#include "tests/src/device_poses.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/temporary_folder.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>

using namespace spherecut;
using namespace spherecut::app;
using spherecut::tests::cut_block;
using spherecut::tests::replaced;
using spherecut::tests::TemporaryFolder;
using spherecut::tests::unturned;

namespace {

/// The block of 60 mm under a blade as wide as it, on a way straight down.
Scenario blade_down(double toughness, const std::string& law = "linear") {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "s.toml")
      << replaced(cut_block, "poisson_ratio = 0.3",
                  "poisson_ratio = 0.3\nlaw = \"" + law + "\"\ntoughness = " + std::to_string(toughness))
      << "[cut]\nfront_spacing = 0.004\n[blade]\nedge = [[0, -0.04, 0], [0, 0.04, 0]]\nstep = 0.1\n"
         "[[blade.path]]\ntime = 0\nposition = [0.004, 0, 0.031]\n[[blade.path]]\ntime = 0.3\nposition = [0.003, 0, "
         "0.013]\n";
  return read_scenario(folder.path() / "s.toml");
}

DeviceState at_height(std::uint64_t tick, double z) {
  return {tick, 1e-3 * static_cast<double>(tick), {0.004, 0, z}, Eigen::Quaterniond::Identity(), true};
}

ContactSnapshot edge_of(double stiffness) {
  ContactSnapshot snapshot;
  snapshot.sequence = 1;
  snapshot.blade.contacts = 3;
  snapshot.blade.along = -Vector3::UnitZ();
  snapshot.blade.edge = 1;
  snapshot.blade.stiffness = stiffness;
  snapshot.blade.due = 1.2;
  snapshot.blade.drag = {0, 0, 0.1};
  snapshot.blade.force = {0, 0, 1.1};
  return snapshot;
}

} // namespace

TEST_CASE("A blade's edge sticks with its stiffness, cuts on at the force that is due, and does not pull") {
  BladeModel model;
  CHECK(model.solved(edge_of(1000)));
  const ModelForce found = model.at({0, 0, 0}, unturned, 0); // by a solve: the force goes on from none
  CHECK(found.force.norm() == 0);
  CHECK(*found.stored == 0);
  CHECK(model.at({0, 0, 0}, unturned, 0.5 * BladeModel::onset).force.z() == Approx(0.55));
  CHECK(model.at({0, 0, 0}, unturned, 1).force.z() == Approx(1.1));
  CHECK(model.at({0, 0, -1e-4}, unturned, 1).force.z() == Approx(1.2)); // 0.1 N stiffer
  CHECK(model.at({0, 0, -1e-3}, unturned, 1).force.z() == Approx(1.3)); // due
  CHECK(model.at({5e-3, 0, -1e-3}, unturned, 1).force.z() == Approx(1.3));
  const double back = model.at({0, 0, -1e-3 + 1e-4}, unturned, 1).force.z();
  CHECK(back < 1.3); // the drag begins to turn over
  CHECK(model.at({0, 0, 2e-3}, unturned, 1).force.z() == Approx(-0.1));
  CHECK(*model.at({0, 0, 2e-3}, unturned, 1).stored >= 0);
  ContactSnapshot free;
  CHECK(model.solved(free)); // it has come out
  CHECK(model.at({0, 0, 0}, unturned, 1).force.norm() == 0);
  CHECK_FALSE(model.solved(free));
}

TEST_CASE("While the edge sticks, its force between solves is that of a solve") {
  HapticSimulation simulation(blade_down(1e4)); // far too tough to cut
  simulation.prepare(at_height(0, 0.031));
  ContactSnapshot snapshot;
  std::uint64_t tick = 0;
  for (const double z : {0.031, 0.0302, 0.0290})
    simulation.solve(at_height(tick++, z), 0, snapshot);
  REQUIRE(snapshot.blade.contacts > 0);
  CHECK(snapshot.count == 0);
  BladeModel model;
  REQUIRE(model.solved(snapshot));
  CHECK(model.at({0.004, 0, 0.0290}, unturned, 0).force.norm() == 0);
  CHECK(model.at({0.004, 0, 0.0290}, unturned, 1).force == snapshot.force);
  for (const double z : {0.0288, 0.0284, 0.0292}) {
    const ModelForce between = model.at({0.004, 0, z}, unturned, 1);
    ContactSnapshot there;
    simulation.solve(at_height(tick++, z), 0, there);
    CHECK(there.force.z() > 0);
    CHECK((between.force - there.force).norm() < 0.02 * there.force.norm());
    CHECK(between.stiffness == Approx(snapshot.blade.stiffness));
  }
}

TEST_CASE(
    "A blade that is pressed slowly, by micrometres from solve to solve, is felt as one that is pressed at once") {
  const auto pressed = [](const std::vector<double>& heights) {
    HapticSimulation simulation(blade_down(1e4)); // far too tough to cut
    simulation.prepare(at_height(0, 0.0302));
    ContactSnapshot snapshot;
    std::uint64_t tick = 0;
    for (const double z : heights)
      simulation.solve(at_height(tick++, z), 0, snapshot);
    return snapshot.force.z();
  };
  std::vector<double> slowly;
  for (int k = 0; k <= 150; ++k)
    slowly.push_back(0.0302 - 4e-6 * k);
  const double at_once = pressed({0.0302, 0.0296});
  CHECK(at_once > 0.05);
  CHECK(pressed(slowly) == Approx(at_once).epsilon(0.02));
}

TEST_CASE("Where an edge has cut nothing yet, its force at most doubles until the next solve") {
  HapticSimulation simulation(blade_down(1000));
  simulation.prepare(at_height(0, 0.031));
  ContactSnapshot snapshot;
  simulation.solve(at_height(0, 0.031), 0, snapshot);
  simulation.solve(at_height(10, 0.029), 0, snapshot);
  REQUIRE(snapshot.blade.contacts > 0);
  REQUIRE(snapshot.blade.edge > 0);
  const double first_cut = 1.2 * 1000 * 0.06; // N, at which one is proposed
  CHECK(snapshot.blade.due <= 2 * std::max(snapshot.blade.edge, first_cut) * (1 + 1e-9));
  CHECK(snapshot.blade.due >= 2 * snapshot.blade.edge);
}

TEST_CASE("The hand feels a blade indent and cut at toughness times width, without steps") {
  const auto law = GENERATE(as<std::string>{}, "linear", "neo_hookean");
  INFO(law);
  const Scenario scenario = blade_down(10, law);
  HapticSettings settings;
  HapticSimulation simulation(scenario);
  ScriptedPath device(simulation.path(), settings.rate);
  const std::uint64_t ticks = 200;
  const LoopRecords records = run_virtual(settings, simulation, device, regular_solves(ticks, 10, 10), ticks);
  double peak = 0;
  double late = 0; // N, sum after cuts
  double area = 0;
  int cuts = 0;
  for (const TickRecord& tick : records.ticks)
    peak = std::max(peak, tick.force.norm());
  for (const SolveRecord& solve : records.solves) {
    CHECK_FALSE(solve.failed);
    CHECK(solve.cut_area >= area);
    if (solve.cut_area > area) {
      late += solve.force.norm();
      ++cuts;
    }
    area = solve.cut_area;
    CHECK(solve.blade_account.surface == Approx(10 * area).margin(1e-12));
  }
  CHECK(area > 1e-4);
  REQUIRE(cuts > 1);
  // A cut leaves the edge with the force of steady cutting. Its length is chosen as if the force rose evenly; tissue at
  // finite strain stiffens under the edge, and leaves it with less.
  CHECK(late / cuts == Approx(10 * 0.06).epsilon(law == "linear" ? 0.2 : 0.25));
  double steepest = 0; // N a tick, of the solved force itself
  for (std::size_t i = 1; i < records.solves.size(); ++i)
    steepest = std::max(steepest, (records.solves[i].force - records.solves[i - 1].force).norm() / 10);
  const ForceSteps steps = force_steps(records);
  CHECK(steps.hand_over < 0.05 * peak);
  CHECK(steepest < 0.06 * peak);
  CHECK(steps.any < 0.02 * peak + steepest); // the onset, that a solve finds, too
  double damped = 0;
  for (const TickRecord& tick : records.ticks)
    damped = std::max(damped, (tick.force - tick.tissue).norm());
  CHECK(damped < 0.01 * peak); // energy that a solve finds is no reason to damp
}

TEST_CASE("Between solves the force on a blade's edge ends where the edge comes out of the body") {
  const auto domain = topology::make_box_domain({-0.03, -0.03, 0}, {0.03, 0.03, 0.03}, 0.005);
  const topology::ContactQuery organ(domain->surface());
  const topology::ToolShape none = topology::SphereTip{0.004};
  HapticTick core({}, none, &organ, false);
  ContactSnapshot snapshot = edge_of(0);
  snapshot.without_tool = true;
  snapshot.pose.point = {0, 0, 0.022};
  snapshot.blade.stored = 0.002;
  snapshot.blade.places = 2; // an upright edge from the blade's position on
  snapshot.blade.place = {Vector3(0, 0, 0), Vector3(0, 0, 0.004)};
  core.start({0, 0, snapshot.pose.point});
  core.arrive(snapshot);
  std::uint64_t tick = 0;
  const auto up_to = [&](double from, double to) {
    TickResult last;
    for (int k = 1; k <= 400; ++k, ++tick)
      last = core.tick({tick, 1e-3 * static_cast<double>(tick), {0, 0, std::lerp(from, to, k / 400.0)}});
    return last.model;
  };
  const double whole = up_to(0.022, 0.0255).force.norm();
  CHECK(whole > 0.5);
  CHECK(up_to(0.0255, 0.0265).force.norm() == Approx(0.75 * whole).epsilon(0.1)); // the upper end, half a millimetre up
  CHECK(up_to(0.0265, 0.029).force.norm() == Approx(0.5 * whole).epsilon(0.1));
  const ModelForce out = up_to(0.029, 0.0311);
  CHECK(out.force.norm() == 0);
  CHECK(*out.stored == 0);
  CHECK(out.active == 0);
  CHECK(up_to(0.0311, 0.05).force.norm() == 0);
}

TEST_CASE("With the controller on, a contact stiffer than the device is rendered as stiff as that") {
  const auto run = [](bool controlled, double stiffness) {
    const topology::ToolShape tool = topology::SphereTip{0.004};
    HapticSettings settings;
    settings.passivity = controlled;
    settings.limits = {.force = 1000, .slew = 1e5, .stiffness = 500, .damping = 0};
    HapticTick core(settings, tool, nullptr);
    ContactSnapshot snapshot = edge_of(stiffness);
    snapshot.blade.edge = 1e-9;
    snapshot.blade.due = 1e9;
    snapshot.blade.drag.setZero();
    snapshot.blade.force = {0, 0, 1e-9};
    core.arrive(snapshot);
    double last = 0;
    double slope = 0;
    double softened = 1;
    for (std::uint64_t t = 0; t < 400; ++t) {
      const double z = -1e-5 * static_cast<double>(t);
      const TickResult result = core.tick({t, 1e-3 * static_cast<double>(t), {0, 0, z}});
      slope = (result.force.z() - last) / 1e-5;
      last = result.force.z();
      softened = result.softened;
    }
    return std::pair{slope, softened};
  };
  CHECK(run(true, 2000).first == Approx(500).epsilon(0.02));
  CHECK(run(true, 2000).second == Approx(0.25));
  CHECK(run(false, 2000).first == Approx(2000).epsilon(0.02));
  CHECK(run(true, 400).first == Approx(400).epsilon(0.02));
  CHECK(run(true, 400).second == 1);
}

TEST_CASE("A resisted blade that is solved at even steps cuts what a run does, and nothing is refused") {
  const std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.45\ntoughness = 10") +
                           R"([cut]
front_spacing = 0.005
[blade]
edge = [[0, -0.04, 0], [0, 0.04, 0]]
step = 0.02
[[blade.path]]
time = 0
position = [0.0021, 0, 0.033]
[[blade.path]]
time = 0.4
position = [0.0021, 0, 0.013]
)";
  const Scenario scenario = spherecut::tests::scenario_of(
      replaced(text, "fine_spacing = 0.005\ncoarse_spacing = 0.012", "random_seed = 7\ncoarse_spacing = 0.012"));
  Session off_line(scenario);
  const double area = spherecut::tests::run(off_line).back().cut->area;
  REQUIRE(area > 9e-4);
  const std::uint64_t period = GENERATE(10, 3);
  HapticSimulation simulation(scenario);
  ScriptedPath device(simulation.path(), 1000);
  ContactSnapshot snapshot;
  simulation.prepare(device.read(0));
  for (std::uint64_t tick = 0; tick <= 450; tick += period) { // the last at rest
    simulation.solve(device.read(std::min<std::uint64_t>(tick, 400)), 0, snapshot);
    CHECK_FALSE(simulation.result().cut->refused);
    if (tick > 400) // it is not left standing before a cut that it does not take
      CHECK(snapshot.blade.edge < 1.5 * 10 * 0.06);
  }
  CHECK(simulation.result().cut->area == Approx(area).epsilon(0.02));
}

TEST_CASE("What a blade passes between two solves is cut, resisted or not") {
  // In, along by 24 mm and out again within 0.3 s; solved three times and a half on the way.
  const bool is_resisted = GENERATE(false, true);
  const std::string text =
      (is_resisted ? replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 1") : cut_block) +
      R"([cut]
front_spacing = 0.004
[blade]
edge = [[0, 0, 0], [0, 0, 0.016]]
step = 0.005
[[blade.path]]
time = 0
position = [-0.012, -0.033, 0.018]
[[blade.path]]
time = 0.1
position = [-0.012, -0.018, 0.018]
[[blade.path]]
time = 0.2
position = [0.012, -0.018, 0.018]
[[blade.path]]
time = 0.3
position = [0.012, -0.034, 0.018]
)";
  const Scenario scenario = spherecut::tests::scenario_of(text);
  Session off_line(scenario);
  const double area = spherecut::tests::run(off_line).back().cut->area;
  REQUIRE(area > 5e-4); // a resisted blade goes on cutting past its turns
  const auto area_when = [&](bool told) {
    HapticSimulation simulation(scenario);
    ScriptedPath device(simulation.path(), 1000);
    ContactSnapshot snapshot;
    simulation.prepare(device.read(0));
    for (std::uint64_t tick = 0; tick <= 340; ++tick)
      if (tick % 85 == 0)
        simulation.solve(device.read(tick), 0, snapshot);
      else if (told)
        simulation.pass(device.read(tick));
    CHECK_FALSE(simulation.result().cut->refused);
    return simulation.session().model().incision != nullptr ? simulation.session().model().incision->area() : 0;
  };
  CHECK(area_when(true) == Approx(area).epsilon(is_resisted ? 0.06 : 0.03)); // which leaves the last of its way uncut
  CHECK(area_when(false) < 0.95 * area);                                     // corners are cut off
}
