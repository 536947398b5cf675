// The parts of a live session behind spherecut serve: the pointer's hand, messages, pictures, a grasper.
#include "src/devices/pointer_hand.hpp"
#include "src/live/surface_follower.hpp"
#include "src/viewer/requests.hpp"

#include "tests/src/viewer/live_server.hpp"
#include "tests/support/allocation_counter.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

PointerTarget target(const Vector3& position, std::uint32_t jumps = 0, HandMode mode = HandMode::probe) {
  PointerTarget result;
  result.position = position;
  result.jumps = jumps;
  result.mode = mode;
  return result;
}

} // namespace

TEST_CASE(
    "A pointer's hand goes to its target no faster than allowed, holds the tool by its spring, and comes to rest") {
  HandSettings settings;
  settings.mass = 0.1;
  settings.stiffness = 300;
  settings.damping = 8;
  PointerHand hand(settings, 1000, 0.2, target({0, 0, 0}));
  static_cast<void>(hand.read(0));
  hand.aim(target({0.05, 0, 0}));
  double fastest = 0;
  Vector3 before = Vector3::Zero();
  DeviceState state;
  const std::size_t allocated = allocations();
  for (std::uint64_t tick = 1; tick <= 2000; ++tick) {
    state = hand.read(tick);
    hand.apply({-0.6, 0, 0});
    fastest = std::max(fastest, (hand.state().hand - before).norm() * 1000);
    before = hand.state().hand;
  }
  CHECK(allocations() == allocated);
  CHECK(fastest < 0.2 * (1 + 1e-9));
  CHECK(fastest > 0.19);
  CHECK((hand.state().hand - Vector3(0.05, 0, 0)).norm() < 1e-6);
  CHECK((state.position - Vector3(0.05 - 0.6 / 300, 0, 0)).norm() < 2e-6); // F = k x
  CHECK(hand.read(2001).position == hand.read(2002).position);
}

TEST_CASE("A tool that is taken up elsewhere is there without force on its way") {
  PointerHand hand({}, 1000, 0.2, target({0, 0, 0}));
  static_cast<void>(hand.read(0));
  PointerTarget away = target({1, 0, 0}, 1, HandMode::blade);
  hand.aim(away);
  int loose = 0;
  for (std::uint64_t tick = 1; tick < 100; ++tick) {
    const DeviceState state = hand.read(tick);
    hand.apply({0, 0, 1});
    loose += state.connected ? 0 : 1;
    if (state.connected) {
      CHECK((state.position - away.position).norm() < 0.01);
      CHECK(state.mode == static_cast<std::uint16_t>(HandMode::blade));
    } else {
      CHECK((state.position.norm() == 0 || state.position == away.position));
    }
  }
  CHECK(loose > 20);
  CHECK(loose < 60);
}

TEST_CASE("Messages are read as they are meant and refused in words") {
  CHECK(parse_request(R"({"type":"pose","n":7,"position":[1,2,3],"orientation":[0,0,0,2]})").pose == 7);
  CHECK(parse_request(R"({"type":"pose","n":7,"position":[1,2,3],"orientation":[0,0,0,2]})").orientation->w() == 1);
  CHECK(parse_request(R"({"type":"set","method":"collocation"})").settings.method == solvers::Method::collocation);
  CHECK(parse_request(R"({"type":"overlays","pick":null})").overlays.pick->has_value() == false);
  for (const char* text : {"",
                           "[]",
                           "{",
                           "nonsense",
                           R"({"type":7})",
                           R"({"type":"none"})",
                           R"({"type":"hello"})",
                           R"({"type":"hello","version":1e99})",
                           R"({"type":"credit","frames":0})",
                           R"({"type":"credit","frames":9})",
                           R"({"type":"credit","frames":-1})",
                           R"({"type":"pose","n":-1,"position":[1,2,3]})",
                           R"({"type":"pose","n":1,"position":[1,2]})",
                           R"({"type":"pose","n":1,"position":[1,2,1e999]})",
                           R"({"type":"pose","n":1,"position":[1,2,"x"]})",
                           R"({"type":"pose","n":1,"position":[1,2,1e9]})",
                           R"({"type":"pose","n":1,"position":[1,2,3],"orientation":[0,0,0,0]})",
                           R"({"type":"pose","n":1,"position":[1,2,3],"hand":3})",
                           R"({"type":"second"})",
                           R"({"type":"second","on":1})",
                           R"({"type":"park","hand":"left"})",
                           R"({"type":"mode","mode":"saw"})",
                           R"({"type":"overlays","slice":{"point":[0,0,0],"normal":[0,0,0],"size":1}})",
                           R"({"type":"overlays","colour":"red"})",
                           R"({"type":"set","method":"fem"})",
                           R"({"type":"set"})",
                           R"({"type":"set","bogus":1})",
                           R"({"type":"set","young_modulus":1e4,"poison_ratio":0.3})",
                           R"({"type":"set","young_modulus":"soft"})",
                           R"({"type":"replay"})"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(parse_request(text), InputError);
  }
  CHECK_THROWS_AS(parse_request(std::string(60'000, '[')), InputError);
  Scenario scenario;
  CHECK_THROWS_WITH(apply(parse_request(R"({"type":"set","poisson_ratio":0.7})").settings, scenario),
                    Catch::Contains("material.poisson_ratio = 0.7"));
  const auto set = [&](const std::string& text) {
    apply(parse_request(R"({"type":"set",)" + text + "}").settings, scenario);
  };
  set(R"("sight":"appended")");
  CHECK(scenario.cut.sight == solvers::SightRule::appended);
  set(R"("method":"collocation")"); // which has other rules: its own
  CHECK_FALSE(scenario.cut.sight);
  CHECK_THROWS_WITH(set(R"("sight":"appended")"), Catch::Contains("'appended' with method 'collocation'"));
}

TEST_CASE("The picture is the field at every vertex, evaluated anew only near the cut") {
  const TemporaryFolder folder;
  const std::string sight = GENERATE(as<std::string>(), "enriched", "appended");
  HapticSimulation simulation(
      read_scenario(write_file(folder.path() / "live.toml", live_block + "[cut]\nsight = \"" + sight + "\"\n")));
  ContactSnapshot snapshot;
  SurfaceFollower follower;
  DeviceState device;
  device.mode = static_cast<std::uint16_t>(HandMode::blade);
  int kept = 0;
  for (int step = 0; step < 6; ++step) {
    device.tick = 10 * static_cast<std::uint64_t>(step); // 0.9 m/s
    device.time = 0.1 * (1 + step);
    device.position = {0.001, -0.04 + 0.009 * step, 0.018};
    simulation.solve(device, 0, snapshot);
    const Session& session = simulation.session();
    follower.follow(session);
    const topology::Wound& wound = *session.wound();
    REQUIRE(follower.topology()->vertices.size() == wound.surface.vertices.size());
    kept += follower.evaluated() < static_cast<int>(wound.surface.vertices.size()) ? 1 : 0;
    std::vector<Eigen::Vector3f> vertices;
    follower.deform(session, vertices);
    double worst = 0;
    for (std::size_t v = 0; v < vertices.size(); ++v)
      worst = std::max(worst, (vertices[v].cast<double>() - wound.surface.vertices[v] -
                               session.model().at(wound.evaluation[v]).displacement)
                                  .norm());
    CHECK(worst < 1e-7);
  }
  CHECK(snapshot.nodes > 0);
  CHECK(kept >= (sight == "appended" ? 1 : 2)); // the functions about a front reach farther
  const ViewerTopology& topology = *follower.topology();
  CHECK(topology.lip_pairs.size() > 5);
  CHECK(std::count(topology.tags.begin(), topology.tags.end(), ViewerTopology::Tag::lip) > 4);
  CHECK(std::count(topology.tags.begin(), topology.tags.end(), ViewerTopology::Tag::front) > 2);
}

TEST_CASE("A grasper in the hand takes hold where it closes, pulls, and lets go") {
  const std::size_t tool = live_block.find("[tool]");
  const std::size_t blade = live_block.find("[blade]");
  const std::string text = live_block.substr(0, tool) + R"([tool]
shape = "grasper"
radius = 0.009
[[tool.path]]
time = 0
position = [0, 0, 0.03]
[[tool.path]]
time = 1
position = [0, 0, 0.034]
)" + live_block.substr(blade);
  const TemporaryFolder folder;
  HapticSimulation simulation(read_scenario(write_file(folder.path() / "live.toml", text)));
  ContactSnapshot snapshot;
  DeviceState device;
  device.mode = static_cast<std::uint16_t>(HandMode::grasper);
  const auto solve = [&](double height, std::uint16_t buttons) {
    device.tick += 10;
    device.time = 1e-3 * static_cast<double>(device.tick);
    device.position = {0, 0, height};
    device.buttons = buttons;
    simulation.solve(device, 0, snapshot);
    return snapshot.force.z();
  };
  CHECK(solve(0.03, 0) == 0);
  CHECK_FALSE(simulation.session().grasps());
  CHECK(std::abs(solve(0.03, 1)) < 1e-3);
  CHECK(simulation.session().grasps());
  const double pulled = solve(0.032, 1);
  CHECK(pulled < -0.05); // the tissue pulls back
  CHECK(solve(0.034, 1) == Approx(2 * pulled).epsilon(0.02));
  CHECK(solve(0.034, 0) == 0);
  CHECK_FALSE(simulation.session().grasps());
}
