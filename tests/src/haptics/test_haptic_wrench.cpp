// The torque that goes with the force: in steps, in what they write, in the haptic tick, and of a blade that is turned.
#include "src/haptics/blade_model.hpp"
#include "src/haptics/tick.hpp"
#include "src/live/virtual_loop.hpp"
#include "src/session/session.hpp"
#include "src/viewer/wire.hpp"

#include "tests/src/device_poses.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/allocation_counter.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;
using spherecut::tests::around;
using spherecut::tests::cut_block;
using spherecut::tests::device_at;
using spherecut::tests::replaced;
using spherecut::tests::run;
using spherecut::tests::scenario_of;
using spherecut::tests::session_of;
using spherecut::tests::small_scenario;
using spherecut::tests::unturned;

namespace {

Eigen::Quaterniond about_y(double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector3::UnitY()));
}

constexpr double edge_lever = 0.012; // m, of an edge from the blade's long axis, which is along it

/// A blade whose edge lies beside its long axis, over the block as long as that; far too tough to cut.
std::string levered_blade(const std::string& poses) {
  return replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 1e4") +
         "[cut]\nfront_spacing = 0.004\n[blade]\nedge = [[0.012, -0.02, 0], [0.012, 0.02, 0]]\nstep = 1\n" + poses;
}

/// Its frame over the block, turned about y: the edge goes down by `edge_lever` times the sine.
constexpr double frame_height = 0.0305; // m

DeviceState turned_by(std::uint64_t tick, double angle) {
  return device_at(tick, {-0.01, 0, frame_height}, about_y(angle));
}

std::string turned_pose(int time, double angle) {
  return "[[blade.path]]\ntime = " + std::to_string(time) + "\nposition = [-0.01, 0, " + std::to_string(frame_height) +
         "]\nrotation = [0, " + std::to_string(angle * 180 / std::numbers::pi) + ", 0]\n";
}

} // namespace

TEST_CASE("Between solves the torque of the tangent model is that of a solve") {
  for (const std::string condition : {"frictionless", "frictional", "bonded"}) {
    HapticSimulation simulation(scenario_of(small_scenario + "[contact]\ncondition = \"" + condition + "\"\n"));
    simulation.prepare(device_at(0, around(0)));
    ContactSnapshot now;
    simulation.solve(device_at(0, around(0)), 0, now);
    const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
    ContactSnapshot first = now;
    model->solved(first);
    double peak = 0, worst = 0;
    for (std::uint64_t tick = 1; tick <= 120; ++tick) {
      const DeviceState device = device_at(tick, around(tick));
      const ModelForce force = model->at(tool_pose(simulation.tool(), device), device.orientation, device.time);
      simulation.solve(device, 0, now);
      peak = std::max(peak, now.torque.norm());
      worst = std::max(worst, (now.torque - force.torque).norm());
      // Without friction it is that of the force in the ball's centre.
      const Vector3 arm = topology::tip_radius(simulation.tool()) * tool_pose(simulation.tool(), device).axis;
      if (condition == "frictionless")
        CHECK((force.torque - arm.cross(force.force)).norm() < 1e-4 * arm.norm() * force.force.norm());
    }
    INFO(condition << ": " << worst << " of " << peak);
    CHECK(peak > 1e-6);
    CHECK(worst < (condition == "frictional" ? 0.04 : 0.01) * peak);
  }
}

TEST_CASE("A torque is held, or goes on along the line through the last two solves, as the force does") {
  const topology::ToolShape ball = topology::SphereTip{0.004};
  ContactSnapshot first, second;
  first.time = 0.01;
  first.force = {0, 0, 1};
  first.torque = {0.02, 0, 0};
  second.time = 0.02;
  second.force = {0, 0, 1.5};
  second.torque = {0.03, 0, 0.01};
  const auto linear = make_force_model(ForceModelKind::linear_in_time, ball);
  const auto hold = make_force_model(ForceModelKind::hold, ball);
  for (const auto* model : {&linear, &hold}) {
    CHECK((*model)->at({}, unturned, 0).torque.norm() == 0);
    (*model)->solved(first);
    (*model)->solved(second);
  }
  CHECK((hold->at({}, unturned, 10).torque - second.torque).norm() == 0);
  CHECK((linear->at({}, unturned, 0.025).torque - Vector3(0.035, 0, 0.015)).norm() < 1e-15);
  CHECK((linear->at({}, unturned, 10).torque - Vector3(0.06, 0, 0.04)).norm() < 1e-15); // three intervals at most
}

TEST_CASE("The torque on the hand is handed over, scaled with the force, limited, and gone with the device") {
  HapticSettings settings;
  settings.model = ForceModelKind::hold;
  settings.passivity = false;
  settings.limits.gain = 2;
  settings.limits.force = 3;
  settings.limits.slew = 100; // N/s: 30 ticks to the limit
  settings.limits.torque = 0.05;
  const topology::ToolShape ball = topology::SphereTip{0.004};
  HapticTick core(settings, ball, nullptr);
  ContactSnapshot contact;
  contact.sequence = 1;
  contact.force = {0, 0, 1};
  contact.torque = {0, 0.01, 0};
  core.arrive(contact);
  double last = 0;
  for (std::uint64_t tick = 0; tick < 60; ++tick) {
    const std::size_t before = tests::allocations();
    const TickResult result = core.tick(device_at(tick, Vector3::Zero()));
    const std::size_t after = tests::allocations();
    CHECK(after == before);
    CHECK(result.torque.y() >= last);
    CHECK(result.torque.y() - last <= 0.05 / 30 + 1e-15);
    CHECK(result.tissue_torque.y() == Approx(0.01 * result.tissue.z()).margin(1e-15)); // by the same hand-over
    last = result.torque.y();
  }
  CHECK(last == Approx(2 * 0.01));
  ContactSnapshot more = contact;
  more.torque = {0, 0.2, 0}; // within the limit of the force, beyond that of the torque
  core.arrive(more);
  for (std::uint64_t tick = 60; tick < 160; ++tick)
    last = core.tick(device_at(tick, Vector3::Zero())).torque.norm();
  CHECK(last == Approx(0.05));
  ContactSnapshot strong = contact;
  strong.force = {0, 0, 4}; // cut to 3 N of 8: so is its torque, and the line on which both act stays
  core.arrive(strong);
  TickResult result;
  for (std::uint64_t tick = 160; tick < 300; ++tick)
    result = core.tick(device_at(tick, Vector3::Zero()));
  CHECK(result.force.z() == Approx(3));
  CHECK(result.torque.y() == Approx(0.02 * 3 / 8));
  DeviceState gone = device_at(300, Vector3::Zero());
  gone.connected = false;
  for (gone.tick = 300; gone.tick < 340; ++gone.tick)
    last = core.tick(gone).torque.norm();
  CHECK(last == 0);
}

TEST_CASE("A blade that is turned about its long axis feels a torque that opposes, of its force and its lever") {
  const double touch = std::asin((frame_height - 0.03) / edge_lever); // angle at which the edge is at the surface
  double before = 0;
  Session session =
      session_of(levered_blade(turned_pose(0, 0) + turned_pose(1, touch + 0.06) + turned_pose(2, touch + 0.12) +
                               turned_pose(3, touch + 0.18) + turned_pose(4, touch + 0.06)));
  std::vector<double> torques;
  for (const StepResult& result : run(session)) {
    const BladeReport& blade = result.cut->blade;
    torques.push_back(blade.torque.y());
    if (blade.force.norm() == 0)
      continue;
    CHECK(blade.torque.y() < 0); // turned about +y
    CHECK(blade.torque.y() == Approx(-edge_lever * blade.force.z()).epsilon(0.05));
    before = std::min(before, blade.torque.y());
  }
  REQUIRE(torques.size() == 5);
  CHECK(torques[0] == 0);
  CHECK(torques[2] < 1.5 * torques[1]); // the farther, the more
  CHECK(torques[3] < 1.2 * torques[2]);
  CHECK(torques[4] > 0.6 * torques[3]); // and less on the way back
  CHECK(before < -1e-4);
}

TEST_CASE("Between solves a blade in the hand feels that it is turned, as a solve would have it") {
  HapticSimulation simulation(scenario_of(levered_blade(turned_pose(0, 0) + turned_pose(1, 0.3))));
  const double touch = std::asin((frame_height - 0.03) / edge_lever);
  simulation.prepare(turned_by(0, 0));
  ContactSnapshot snapshot;
  simulation.solve(turned_by(0, 0), 0, snapshot);
  simulation.solve(turned_by(10, touch + 0.06), 0, snapshot);
  simulation.solve(turned_by(20, touch + 0.12), 0, snapshot);
  REQUIRE(snapshot.blade.contacts > 0);
  BladeModel model;
  REQUIRE(model.solved(snapshot));
  const Vector3 place = turned_by(0, 0).position;
  CHECK(model.at(place, turned_by(0, touch + 0.12).orientation, 0).torque.norm() == 0); // found, and goes on from none
  const ModelForce here = model.at(place, turned_by(0, touch + 0.12).orientation, 1);
  CHECK(here.force == snapshot.force);
  CHECK((here.torque - snapshot.torque).norm() < 1e-12 * snapshot.torque.norm());
  const std::size_t before = tests::allocations();
  const ModelForce on = model.at(place, turned_by(0, touch + 0.14).orientation, 1),
                   back = model.at(place, turned_by(0, touch + 0.10).orientation, 1);
  CHECK(tests::allocations() == before);
  CHECK(on.torque.y() < here.torque.y());
  CHECK(back.torque.y() > here.torque.y());
  // The energy behind the force rises by what turning takes.
  const double work = -0.5 * (on.torque + back.torque).y() * 0.04;
  CHECK(*on.stored - *back.stored == Approx(work).epsilon(1e-6));
  ContactSnapshot there;
  simulation.solve(turned_by(30, touch + 0.14), 0, there);
  CHECK((on.torque - there.torque).norm() < 0.05 * there.torque.norm());
  CHECK((on.force - there.force).norm() < 0.05 * there.force.norm());
}

TEST_CASE("A viewer of the first version gets the frame that it got, one of the second the torque behind it") {
  LiveTick tick;
  tick.record.tissue = {1, 2, 3};
  tick.record.tissue_torque = {4, 5, 6};
  tick.record.torque = {7, 8, 9};
  FrameContext context;
  context.message = 5;
  CHECK(context.version == 2);
  const std::string now = encode_frame({}, tick, context, {}, 1, false);
  context.version = 1;
  const std::string old = encode_frame({}, tick, context, {}, 1, false);
  REQUIRE(old.size() == 248);
  REQUIRE(now.size() == 272);
  CHECK(old[1] == 1);
  CHECK(now[1] == 2);
  CHECK(old.substr(8) == now.substr(8, 240)); // after version, offset and length
  std::array<float, 6> torques{};
  std::memcpy(torques.data(), now.data() + 248, sizeof torques);
  CHECK(torques == std::array<float, 6>{4, 5, 6, 7, 8, 9});
  CHECK(encode_topology({}, 1, 1, 1)[1] == 1);
  CHECK(encode_topology({}, 2, 1, 1)[1] == 2);
}

TEST_CASE("A step says its torque, a ball's is that of its force in the centre, and a loop replays it to the bit") {
  const Scenario scenario = scenario_of(small_scenario);
  HapticSettings settings;
  const auto session = [&] {
    HapticSimulation simulation(scenario);
    ScriptedPath device(simulation.path(), settings.rate);
    return run_virtual(settings, simulation, device, regular_solves(600, 20, 7), 600);
  };
  const LoopRecords first = session(), second = session();
  double peak = 0;
  bool same = true;
  for (std::size_t i = 0; i < first.ticks.size(); ++i) {
    peak = std::max(peak, first.ticks[i].tissue_torque.norm());
    same = same && first.ticks[i].torque == second.ticks[i].torque &&
           first.ticks[i].tissue_torque == second.ticks[i].tissue_torque;
  }
  CHECK(same);
  CHECK(peak > 0);
  Session steps(scenario);
  const double radius = topology::tip_radius(scenario.tool->shape);
  double largest = 0;
  for (const StepResult& result : run(steps)) {
    const Vector3 arm = radius * result.pose.axis;
    CHECK((result.torque - arm.cross(result.force)).norm() < 1e-5 * radius * result.force.norm() + 1e-15);
    largest = std::max(largest, result.force.norm());
  }
  CHECK(largest > 0.01);
}
