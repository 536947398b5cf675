// The device of an Inverse3 against a stand-in for its service. Under AddressSanitizer and ThreadSanitizer too: the
// sources it needs and no more are compiled into this binary.
#include "src/devices/haply_device.hpp"
#include "src/haptics/tick.hpp"
#include "tests/support/allocation_counter.hpp"
#include "tests/support/haply_service.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <chrono>
#include <limits>
#include <random>

using namespace spherecut;
using namespace spherecut::app;
using tests::HaplyService;

namespace {

const PathPose waiting{0, {0.01, 0.02, 0.03}, Eigen::Quaterniond::Identity()};
constexpr double patient = 100; // s without a pose: never, in ticks that wait for nothing

HaplySettings at(const HaplyService& service, double timeout = patient) {
  return {service.address(), "", timeout};
}

/// Ticks of a loop that gives one force, a millisecond apart, until something is so; for half a minute at most.
class Loop {
 public:
  explicit Loop(HaplyDevice& device) : device_(device) {}
  template <typename Condition>
  bool until(Condition condition, const Vector3& force = Vector3::Zero()) {
    for (int i = 0; i < 30000; ++i) {
      state = device_.read(tick_++);
      device_.apply(force);
      if (condition())
        return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }
  DeviceState state;

 private:
  HaplyDevice& device_;
  std::uint64_t tick_ = 0;
};

std::string complaint(const HaplySettings& settings) {
  try {
    const HaplyDevice device(settings, waiting, 1000);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

} // namespace

TEST_CASE("The address of a WebSocket is read, and what is none is not taken") {
  const auto local = websocket_address("ws://localhost:10001");
  REQUIRE(local);
  CHECK(local->host == "localhost");
  CHECK(local->port == 10001);
  CHECK(local->path == "/");
  const auto six = websocket_address("ws://[::1]:9000/a/b?c");
  REQUIRE(six);
  CHECK(six->host == "::1");
  CHECK(six->port == 9000);
  CHECK(six->path == "/a/b?c");
  for (const char* text :
       {"", "ws://", "ws://localhost", "ws://:10001", "ws://localhost:", "ws://localhost:0", "ws://localhost:65536",
        "ws://localhost:1x", "ws://localhost:-1", "wss://localhost:10001", "http://localhost:10001", "localhost:10001",
        "ws://a b:1", "ws://::1:10001", "ws://u@h:1", "ws://h:1/a b"})
    CHECK_FALSE(websocket_address(text));
}

TEST_CASE("The documented messages of the Inverse3's service are read, and a force is written as documented") {
  HaplyPose pose;
  REQUIRE(read_haply_message(tests::haply_inventory(), "", pose) == HaplyMessage::pose);
  CHECK(pose.cursor == Vector3(0, -0.12, 0.15));
  CHECK_FALSE(pose.has_grip);
  CHECK(read_haply_message(tests::haply_inventory(), "049D", pose) == HaplyMessage::pose);
  CHECK(read_haply_message(tests::haply_inventory(), "049E", pose) == HaplyMessage::no_device);
  CHECK(haply_devices(tests::haply_inventory()) == std::vector<std::string>{"049D"});
  CHECK(read_haply_message(R"({"session_id": 7})", "", pose) == HaplyMessage::no_device);
  CHECK(read_haply_message(R"({"session_id": 7, "inverse3": []})", "", pose) == HaplyMessage::no_device);
  const std::string head = R"({"inverse3": [{"device_id": "A", "state": {"cursor_position": )";
  REQUIRE(read_haply_message(head + R"({"x": 1, "y": 2e-2, "z": -3}}}],
      "verse_grip": [{"device_id": "B", "state": {"orientation": {"w": 0, "x": 0, "y": 0, "z": 1}, "button": true}}]})",
                             "A", pose) == HaplyMessage::pose);
  CHECK(pose.cursor == Vector3(1, 0.02, -3));
  CHECK(pose.has_grip);
  CHECK(pose.grip.z() == 1);
  CHECK(pose.buttons == 1);
  REQUIRE(read_haply_message(head + R"({"x": 1, "y": 2, "z": 3}}}], "wireless_verse_grip": [{"device_id": "B", "state":
      {"orientation": {"w": 1, "x": 0, "y": 0, "z": 0}, "buttons": {"a": false, "b": true, "c": true}}}]})",
                             "A", pose) == HaplyMessage::pose);
  CHECK(pose.buttons == 6);
  for (const std::string& wrong :
       {std::string(), std::string("[]"), std::string("{"), std::string("7"), std::string(R"({"inverse3": 1})"),
        std::string(R"({"inverse3": [1]})"), std::string(R"({"inverse3": [{"device_id": 5}]})"),
        std::string(R"({"inverse3": [{"device_id": "A"}]})"), head + R"({"x": 1, "y": 2}}}]})",
        head + R"({"x": 1, "y": 2, "z": "3"}}}]})", head + R"({"x": 1, "y": 2, "z": 1e9}}}]})",
        head + R"({"x": 1, "y": 2, "z": null}}}]})"})
    CHECK(read_haply_message(wrong, "A", pose) == HaplyMessage::garbage);
  CHECK(haply_force_message("049D", {0, 0, 1.5}, false) ==
        R"({"inverse3":[{"commands":{"set_cursor_force":{"vector":{"x":0.0,"y":0.0,"z":1.5}}},"device_id":"049D"}]})");
  CHECK_THAT(haply_force_message("049D", {0, 0, 1.5}, true),
             Catch::Contains(R"("session":{"configure":{"profile":{"name":"org.spherecut:haptics"}}})"));
}

TEST_CASE("No text does the reader of the Inverse3's messages harm, and what it takes is in range") {
  std::mt19937_64 random(13);
  const std::string good = tests::haply_inventory();
  int taken = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string text = good;
    for (std::size_t k = 0; k <= random() % 3; ++k)
      text[random() % text.size()] = static_cast<char>(random());
    if (i % 4 == 0)
      text.resize(random() % text.size());
    HaplyPose pose;
    static_cast<void>(haply_devices(text));
    if (read_haply_message(text, "049D", pose) != HaplyMessage::pose)
      continue;
    ++taken;
    CHECK(pose.cursor.cwiseAbs().maxCoeff() <= 10);
    CHECK(pose.grip.norm() == Approx(1));
  }
  CHECK(taken > 100);
}

TEST_CASE("The tool follows the Inverse3 from where it waits, and the force of the loop is what the service is told") {
  HaplyService service;
  HaplyDevice device(at(service), waiting, 1000);
  CHECK(device.device_id() == "049D");
  Loop loop(device);
  REQUIRE(loop.until([&] { return loop.state.connected; }));
  CHECK((loop.state.position - waiting.position).norm() < 1e-12);
  service.set_cursor({0.001, -0.12, 0.148});
  const Vector3 moved = waiting.position + Vector3(0.001, 0, -0.002);
  CHECK(loop.until([&] { return (loop.state.position - moved).norm() < 1e-12; }, {0, 0, 1.5}));
  CHECK(loop.until([&] { return service.force() == HaplyService::Vector{0, 0, 1.5}; }, {0, 0, 1.5}));
  const double half = std::sqrt(0.5);
  service.set_grip({1, 0, 0, 0}, false);
  CHECK(loop.until([&] { return loop.state.buttons == 0 && service.messages() > 100; }));
  service.set_grip({half, half, 0, 0}, true); // a quarter about x since it was first seen
  CHECK(loop.until([&] {
    return loop.state.buttons == 1 && (loop.state.orientation * Vector3::UnitZ() + Vector3::UnitY()).norm() < 1e-9;
  }));
  CHECK(device.link() == HaplyLink::streams);
  CHECK(service.refused() == 0);
  CHECK(service.named() == 1);
  CHECK(device.counters().garbage == 0);
  CHECK(device.counters().messages > 100);
  CHECK(device.counters().poses > 0);
}

TEST_CASE("A session with an Inverse3 ends without a force, and closes as the protocol has it") {
  HaplyService service;
  {
    HaplyDevice device(at(service), waiting, 1000);
    Loop loop(device);
    CHECK(loop.until([&] { return service.force()[2] == 2; }, {0, 0, 2}));
  }
  for (int i = 0; i < 30000 && !service.closed_well(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  CHECK(service.closed_well());
  CHECK(service.force() == HaplyService::Vector{0, 0, 0});
}

TEST_CASE("A loop that stands still gives the Inverse3 no force") {
  HaplyService service;
  HaplyDevice device(at(service, 0.05), waiting, 1000);
  Loop loop(device);
  CHECK(loop.until([&] { return service.force()[2] == 2; }, {0, 0, 2}));
  for (int i = 0; i < 30000 && service.force()[2] != 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  CHECK(service.force() == HaplyService::Vector{0, 0, 0});
  CHECK(loop.until([&] { return service.force()[2] == 2; }, {0, 0, 2}));
}

TEST_CASE("A silent service takes the force to zero at the slew limit, and the tool goes on once it speaks again") {
  HaplyService service;
  HaplyDevice device(at(service, 0.02), waiting, 1000);
  Loop loop(device);
  REQUIRE(loop.until([&] { return loop.state.connected; }));
  HapticSettings settings;
  settings.model = ForceModelKind::hold;
  settings.passivity = false;
  const topology::ToolShape shape = topology::FlatPunch{0.01, 0.03};
  HapticTick core(settings, shape, nullptr);
  ContactSnapshot snapshot;
  clear(snapshot);
  snapshot.force = {0, 0, 3};
  core.arrive(snapshot);
  Vector3 force = Vector3::Zero();
  const auto held = [&] {
    force = core.tick(loop.state).force;
    return force.z() == Approx(3);
  };
  REQUIRE(loop.until(held));
  service.set_silent(true);
  double before = 3;
  double largest = 0;
  CHECK(loop.until([&] {
    force = core.tick(loop.state).force;
    if (!loop.state.connected)
      largest = std::max(largest, std::abs(force.z() - before));
    before = force.z();
    return !loop.state.connected && force.z() == 0;
  }));
  CHECK(largest <= settings.limits.slew / settings.rate + 1e-12);
  CHECK(device.link() == HaplyLink::silent);
  CHECK(device.counters().lost >= 1);
  CHECK((loop.state.position - waiting.position).norm() < 1e-12); // where it was
  service.set_silent(false);                                      // after two seconds the connection is made anew
  CHECK(loop.until([&] { return loop.state.connected && device.link() == HaplyLink::streams; }));
}

TEST_CASE("A service that ends and begins again is found again, and one without its Inverse3 says so") {
  auto service = std::make_unique<HaplyService>();
  const int port = service->port();
  HaplyDevice device(at(*service, 0.05), waiting, 1000);
  Loop loop(device);
  REQUIRE(loop.until([&] { return loop.state.connected; }));
  service->set_plugged(false);
  CHECK(loop.until([&] { return !loop.state.connected && device.link() == HaplyLink::no_device; }));
  service->set_plugged(true);
  CHECK(loop.until([&] { return loop.state.connected && device.link() == HaplyLink::streams; }));
  service->set_nonsense(true);
  CHECK(loop.until([&] { return !loop.state.connected && device.link() == HaplyLink::silent; }));
  CHECK(device.counters().garbage > 0);
  service = nullptr;
  CHECK(loop.until([&] { return !loop.state.connected && device.link() == HaplyLink::gone; }));
  service = std::make_unique<HaplyService>(port, HaplyService::Vector{0.05, -0.1, 0.2});
  CHECK(loop.until([&] { return loop.state.connected && device.link() == HaplyLink::streams; }));
  CHECK((loop.state.position - waiting.position).norm() < 1e-12); // the tool has not jumped by where the cursor is
  CHECK(device.counters().renewed == 1);
  CHECK(loop.until([&] { return service->named() == 1; }));
}

TEST_CASE(
    "A service slower than the loop is a slow client: the tool goes evenly, and energy is counted by its readings") {
  HaplyService service;
  service.set_pause(12);
  HaplyDevice device(at(service), waiting, 1000);
  Loop loop(device);
  CHECK(loop.until([&] { return device.pace().kind == PaceKind::interpolated && loop.state.client.period > 2; }));
  service.set_cursor({0, -0.12, 0.149});
  double largest = 0;
  double before = loop.state.position.z();
  CHECK(loop.until([&] {
    largest = std::max(largest, std::abs(loop.state.position.z() - before));
    before = loop.state.position.z();
    return std::abs(before - (waiting.position.z() - 0.001)) < 1e-9;
  }));
  CHECK(largest < 0.0006); // of the millimetre that the cursor jumped
  CHECK(device.counters().interpolated > 0);
}

TEST_CASE("Ticks with an Inverse3 do not allocate") {
  HaplyService service;
  HaplyDevice device(at(service), waiting, 1000);
  Loop loop(device);
  REQUIRE(loop.until([&] { return loop.state.connected; }));
  std::uint64_t tick = 100000;
  const std::size_t before = tests::allocations();
  for (int i = 0; i < 1000; ++i) {
    static_cast<void>(device.read(tick++));
    device.apply({0, 0, 1});
  }
  CHECK(tests::allocations() == before);
}

TEST_CASE("What is wrong with the service of an Inverse3 is said with its address") {
  CHECK_THAT(complaint({"ws://127.0.0.1:" + std::to_string(tests::free_port()), "", 0.1}),
             Catch::StartsWith("haptics.haply.address = \"ws://127.0.0.1:") &&
                 Catch::Contains("no Inverse service answers there"));
  CHECK_THAT(complaint({"http://localhost:10001", "", 0.1}), Catch::Contains("allowed: ws://HOST:PORT"));
  HaplyService service;
  CHECK_THAT(complaint({service.address(), "AAAA", 0.1}),
             Catch::Contains("no Inverse3 \"AAAA\"") && Catch::Contains("haptics.haply.device_id: 049D"));
  service.set_plugged(false);
  CHECK_THAT(complaint(at(service)), Catch::Contains("the service has no Inverse3"));
  service.set_plugged(true);
  service.set_nonsense(true);
  CHECK_THAT(complaint(at(service)), Catch::Contains("no Inverse service"));
}
