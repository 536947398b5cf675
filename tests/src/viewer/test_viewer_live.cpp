// The live session behind spherecut serve: pointer, pictures, messages, and the real loop with clients of its own.
#include "src/devices/pointer_hand.hpp"
#include "src/live/surface_follower.hpp"
#include "src/viewer/hub.hpp"

#include "tests/src/scenario_text.hpp"
#include "tests/support/allocation_counter.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/web_client.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Json = nlohmann::json;

namespace {

/// A stretched block with a ball and a blade to hold, about 150 nodes.
const std::string live_block = "title = \"live\"\n" + block_organ + R"(pretension = [0.05, 0.0, 0.0]
[[fixed]]
name = "sides"
region = "half_space"
point = [-0.029, 0, 0]
normal = [1, 0, 0]
[[fixed]]
name = "other side"
region = "half_space"
point = [0.029, 0, 0]
normal = [-1, 0, 0]
[nodes]
fine_spacing = 0.007
coarse_spacing = 0.014
fine_radius = 0.008
)" + replaced(ball_tool, "0.001", "0.005") +
                               R"([blade]
edge = [[0, 0, 0], [0, 0, 0.03]]
edge_radius = 1e-4
[[blade.path]]
time = 0
position = [0, -0.05, 0.02]
[[blade.path]]
time = 1
position = [0, -0.04, 0.02]
[haptics]
budget = 5.0
[output]
figures = false
)";

PointerTarget target(const Vector3& position, std::uint32_t jumps = 0, HandMode mode = HandMode::probe) {
  PointerTarget result;
  result.position = position;
  result.jumps = jumps;
  result.mode = mode;
  return result;
}

/// A hub on a server of its own, driven by a thread.
class Served {
 public:
  explicit Served(const std::string& text = live_block, const std::filesystem::path& recordings = {}) {
    HubOptions settings;
    settings.scenario = write_file(folder_.path() / "live.toml", text);
    settings.recordings = recordings.empty() ? folder_.path() / "recordings" : recordings;
    write_file(folder_.path() / "bad.toml", replaced(text, "young_modulus = 1e4", "young_modulus = -1"));
    hub_ = std::make_unique<Hub>(settings, [](const std::string&) {});
    WebServerOptions options;
    options.port = 0;
    WebServer::Handlers handlers;
    handlers.opened = [this](int client) { hub_->opened(client); };
    handlers.message = [this](int client, std::string_view what) { return hub_->message(client, what); };
    handlers.closed = [this](int client) { hub_->closed(client); };
    handlers.tick = [this] {
      hub_->tick();
      if (stop_)
        server_->stop();
    };
    server_ = std::make_unique<WebServer>(options, handlers);
    hub_->attach(*server_);
    thread_ = std::thread([this] { server_->run(); });
  }
  ~Served() {
    stop_ = true;
    thread_.join();
    server_.reset();
    hub_.reset();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;
  [[nodiscard]] int port() const { return server_->port(); }
  [[nodiscard]] const TemporaryFolder& folder() const { return folder_; }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<Hub> hub_;
  std::unique_ptr<WebServer> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// What a page knows, read from the bytes as docs/viewer_protocol.md has them.
class Viewer {
 public:
  explicit Viewer(int port, int version = 2) : version_(version), socket_(port) {
    say({{"type", "hello"}, {"version", version}});
    say({{"type", "credit"}, {"frames", 2}});
  }
  void say(const Json& message) { socket_.send(message.dump()); }
  void pose(const Vector3& at) { say({{"type", "pose"}, {"n", ++number}, {"position", {at.x(), at.y(), at.z()}}}); }
  void pose_second(const Vector3& at) {
    say({{"type", "pose"}, {"n", ++number}, {"hand", 2}, {"position", {at.x(), at.y(), at.z()}}});
  }
  /// Takes messages until the condition holds.
  template <typename Condition>
  bool until(const Condition& condition, double seconds = 60) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!condition()) {
      const auto message = socket_.receive(1);
      if ((!message && !socket_.open()) || std::chrono::steady_clock::now() > end)
        return false;
      if (message)
        take(*message);
    }
    return true;
  }
  [[nodiscard]] Vector3 vector(std::size_t offset) const {
    return {value<float>(offset), value<float>(offset + 4), value<float>(offset + 8)};
  }
  template <typename T>
  [[nodiscard]] T value(std::size_t offset) const {
    T result;
    std::memcpy(&result, frame.data() + offset, sizeof result);
    return result;
  }
  /// Data of a section of a message; empty: it has none.
  static std::string section(const std::string& bytes, std::uint32_t kind) {
    std::uint16_t start = 0;
    std::memcpy(&start, bytes.data() + 2, 2);
    for (std::size_t at = start; at + 8 <= bytes.size();) {
      std::uint32_t found = 0;
      std::uint32_t length = 0;
      std::memcpy(&found, bytes.data() + at, 4);
      std::memcpy(&length, bytes.data() + at + 4, 4);
      if (found == kind)
        return bytes.substr(at + 8, length);
      at += 8 + (length + 3) / 4 * 4;
    }
    return {};
  }

  std::uint32_t number = 0;
  Json welcome, session, holder, mode, second, recording, replay;
  std::vector<Json> errors;
  std::string topology, frame, picture; // the newest; picture: the newest frame with vertices
  int topologies = 0, frames = 0, pictures = 0;
  bool sound = true; // every header told its length

 private:
  void take(const WebMessage& message) {
    if (!message.binary) {
      const Json json = Json::parse(message.bytes);
      const std::string type = json["type"];
      if (type == "error")
        errors.push_back(json);
      for (const auto& [name, place] : {std::pair<const char*, Json*>{"welcome", &welcome},
                                        {"session", &session},
                                        {"holder", &holder},
                                        {"mode", &mode},
                                        {"second", &second},
                                        {"recording", &recording},
                                        {"replay", &replay}})
        if (type == name)
          *place = json;
      return;
    }
    std::uint32_t length = 0;
    std::memcpy(&length, message.bytes.data() + 4, 4);
    sound = sound && length == message.bytes.size() && message.bytes[1] == version_;
    if (message.bytes[0] == 1) {
      topology = message.bytes;
      ++topologies;
      return;
    }
    frame = message.bytes;
    ++frames;
    if (!section(frame, 16).empty()) {
      picture = frame;
      ++pictures;
    }
    say({{"type", "credit"}, {"frames", 1}});
  }
  int version_; // of the protocol
  WebSocketClient socket_;
};

double force_of(const Viewer& viewer) {
  return viewer.frame.empty() ? 0 : viewer.vector(116).norm();
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

TEST_CASE("One viewer presses and cuts while another watches, over the wire") {
  const Served served;
  Viewer first(served.port());
  Viewer second(served.port(), 1); // as viewers were before there were torques
  REQUIRE(first.until([&] { return first.pictures > 0 && !first.welcome.is_null(); }));
  CHECK(first.welcome["version"] == 2);
  CHECK(first.session["modes"] == Json({"probe", "blade"}));
  CHECK(first.welcome["scenarios"].size() == 2);
  CHECK(first.topologies == 1);
  first.say({{"type", "take"}});
  REQUIRE(first.until([&] { return first.holder["id"] == first.welcome["id"]; }));
  REQUIRE(second.until([&] { return second.holder["id"] == first.welcome["id"]; }));

  SECTION("a press is felt, shown, and pushes the tool off the hand") {
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.027});
    REQUIRE(first.until([&] { return force_of(first) > 0.02 && first.value<std::uint32_t>(56) == 2; }));
    CHECK(first.vector(116).z() > 0);
    CHECK((first.value<std::uint32_t>(44) & 1U) == 1);
    REQUIRE(first.until([&] { return first.vector(76).z() - first.vector(64).z() > 1e-5; }));
    REQUIRE(second.until([&] { return force_of(second) > 0.02; })); // who watches sees the same
    CHECK(second.welcome["version"] == 1);
    CHECK(second.value<std::uint16_t>(2) == 248);
    CHECK(first.value<std::uint16_t>(2) == 272);
    const Vector3 arm = 0.01 * first.vector(104); // of the ball's centre, on whose line the force acts
    CHECK((first.vector(248) - arm.cross(first.vector(116))).norm() < 1e-3 * arm.norm() * force_of(first));
    second.say({{"type", "pose"}, {"n", 1}, {"position", {0, 0, 0.2}}});
    second.say({{"type", "take"}});
    REQUIRE(second.until([&] { return second.errors.size() == 2; }));
    CHECK(second.errors[0]["code"] == "no_tool");
    CHECK(second.errors[1]["code"] == "taken");
    first.say({{"type", "overlays"},
               {"colour", "von_mises"},
               {"nodes", true},
               {"stages", true},
               {"pick", {0, 0, 0.03}},
               {"slice", {{"point", {0, 0, 0.015}}, {"normal", {0, 1, 0}}, {"size", 0.08}, {"count", 16}}}});
    REQUIRE(first.until([&] { return !Viewer::section(first.picture, 20).empty(); }));
    std::uint32_t vertices = 0;
    std::memcpy(&vertices, first.picture.data() + 40, 4);
    CHECK(Viewer::section(first.picture, 16).size() == 12 * vertices);
    CHECK(Viewer::section(first.picture, 17).size() == 12 + 4 * vertices);
    CHECK(Viewer::section(first.picture, 20).size() == 40 + 8 * 256);
    CHECK(Viewer::section(first.picture, 22).size() == 32);
    const std::string nodes = Viewer::section(first.picture, 18);
    std::uint32_t count = 0;
    std::memcpy(&count, nodes.data(), 4);
    CHECK(count > 50);
    CHECK(nodes.size() == 4 + 17 * count);
    CHECK(Viewer::section(first.picture, 19).size() > 28);
    // The slice is 80 mm wide about the middle of a block of 60 x 30 mm: outside at its corner, 14 mm deep in its
    // middle.
    const std::string slice = Viewer::section(first.picture, 20);
    const auto distance = [&](std::size_t row, std::size_t column) {
      float value = 0;
      std::memcpy(&value, slice.data() + 40 + 4 * (16 * row + column), 4);
      return static_cast<double>(value);
    };
    CHECK(distance(0, 0) == Approx(std::hypot(0.01, 0.025)).margin(2e-3));
    CHECK(distance(7, 7) == Approx(-0.015 + 0.04 / 15).margin(2e-3));
    CHECK(Viewer::section(second.picture, 18).empty()); // only who asked
  }

  SECTION("a cut where the blade is drawn changes the surface, parts the lips, and a reset heals it") {
    first.say({{"type", "mode"}, {"mode", "blade"}});
    REQUIRE(first.until([&] { return first.mode["mode"] == "blade"; }));
    for (int step = 0; step <= 30; ++step) {
      first.pose({0.002, -0.045 + 0.002 * step, 0.018});
      const int seen = first.frames;
      REQUIRE(first.until([&] { return first.frames > seen; }));
    }
    REQUIRE(first.until([&] { return first.value<std::uint32_t>(56) == first.number && first.topologies > 1; }));
    CHECK(first.value<float>(216) > 1e-4); // m2
    CHECK(first.value<float>(224) > 2e-4); // m, it gapes
    const std::string pairs = Viewer::section(first.topology, 6);
    REQUIRE(pairs.size() > 80);
    const std::string places = Viewer::section(first.picture, 16);
    double apart = 0;
    for (std::size_t k = 0; k < pairs.size(); k += 8) {
      std::array<std::uint32_t, 2> pair{};
      std::memcpy(pair.data(), pairs.data() + k, 8);
      std::array<std::array<float, 3>, 2> ends{};
      for (std::size_t i = 0; i < 2; ++i)
        std::memcpy(ends[i].data(), places.data() + 12 * pair[i], 12);
      apart = std::max(apart, static_cast<double>(std::abs(ends[0][0] - ends[1][0])));
    }
    CHECK(apart > 2e-4);
    CHECK(second.until([&] { return second.topologies > 1; }));
    first.say({{"type", "reset"}});
    REQUIRE(first.until(
        [&] { return first.session["epoch"] == 2 && !first.frame.empty() && first.value<std::uint32_t>(12) == 2; }));
    CHECK(first.value<float>(216) == 0);
    // The blade rests in the organ, as it did when the new session took over: it does not come through the surface.
    for (int again = 0; again < 12; ++again) {
      first.pose({0.002, 0.015, 0.018});
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    REQUIRE(first.until([&] { return !first.errors.empty(); }));
    CHECK(first.errors[0]["about"] == "pose");
    CHECK(first.value<float>(216) == 0);
    CHECK(first.vector(64).norm() > 0.04);
    first.pose({0.002, -0.045, 0.018});
    REQUIRE(first.until([&] { return (first.vector(64) - Vector3(0.002, -0.045, 0.018)).norm() < 1e-4; }));
    first.pose({0.002, 0.015, 0.018});
    CHECK(first.until([&] { return first.value<float>(216) > 1e-4; }));
    CHECK(first.errors.size() == 1);
  }

  SECTION("what cannot be built is told, and the session stays") {
    first.say({{"type", "scenario"}, {"name", "bad.toml"}});
    REQUIRE(first.until([&] { return first.errors.size() == 1; }));
    CHECK(first.errors[0]["code"] == "refused");
    CHECK_THAT(first.errors[0]["text"].get<std::string>(), Catch::Contains("young_modulus"));
    first.say({{"type", "scenario"}, {"name", "../live.toml"}});
    first.say({{"type", "set"}, {"coarse_spacing", 1e-4}, {"fine_spacing", 1e-3}});
    REQUIRE(first.until([&] { return first.errors.size() == 3; }));
    CHECK(first.session["epoch"] == 1);
    first.say({{"type", "set"}, {"young_modulus", 2e4}});
    REQUIRE(first.until([&] { return first.session["epoch"] == 2; }));
    CHECK(first.session["settings"]["young_modulus"] == 2e4);
  }

  SECTION("a solve that fails is told in words, and the session goes on") {
    first.pose({0.045, 0, 0.028});
    first.pose({0.031, 0, 0.022}); // into the side that is held
    REQUIRE(first.until([&] { return !first.errors.empty(); }));
    CHECK(first.errors[0]["code"] == "solver");
    CHECK(first.errors[0]["about"] == "session");
    CHECK(first.errors[0]["text"].get<std::string>().size() > 20);
    first.say({{"type", "park"}});
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.027});
    CHECK(first.until([&] { return force_of(first) > 0.02 && (first.value<std::uint32_t>(44) & 32U) == 0; }));
  }

  SECTION("the tool comes free with its holder, and a recording replays") {
    // A link out of the folder that leads nowhere is no name to write to.
    const std::filesystem::path outside = served.folder().path() / "outside";
    std::filesystem::create_directories(served.folder().path() / "recordings");
    std::filesystem::create_symlink(outside, served.folder().path() / "recordings" / "session-1.recording");
    first.say({{"type", "record"}, {"on", true}});
    REQUIRE(first.until([&] { return first.recording["on"] == true; }));
    Viewer later(served.port());
    CHECK(later.until([&] { return !later.recording.is_null() && later.recording["on"] == true; }));
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.028});
    REQUIRE(first.until([&] { return force_of(first) > 0.01; }));
    first.say({{"type", "record"}, {"on", false}});
    REQUIRE(first.until([&] { return first.recording["on"] == false; }));
    const std::string name = first.recording["name"];
    CHECK(name == "session-2.recording");
    CHECK_FALSE(std::filesystem::exists(outside));
    CHECK(std::filesystem::file_size(served.folder().path() / "recordings" / name) > 1000);
    // The same file runs again off line, bit by bit.
    const ProgramResult again =
        run_spherecut({"haptics", "--replay", (served.folder().path() / "recordings" / name).string(), "--out",
                       (served.folder().path() / "again").string()});
    INFO(again.out << again.err);
    CHECK(again.status == 0);
    first.say({{"type", "replay"}, {"name", name}});
    REQUIRE(first.until([&] { return first.replay["on"] == true; }));
    REQUIRE(first.until([&] { return force_of(first) > 0.01 && (first.value<std::uint32_t>(44) & 4U) != 0; }));
    Viewer last(served.port()); // who comes meanwhile is told
    CHECK(last.until([&] { return !last.replay.is_null() && last.replay["name"] == name; }));
    first.say({{"type", "release"}});
    REQUIRE(second.until([&] { return second.holder["id"].is_null(); }));
  }
  CHECK(first.sound);
  CHECK(second.sound);
}

TEST_CASE("Two hands of one viewer: the probe rests on the body while the blade cuts, and a recording has both") {
  const Served served(replaced(live_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 5"));
  Viewer viewer(served.port());
  Viewer watcher(served.port());
  const auto blade = [&](std::size_t offset) { // of section 23
    const std::string bytes = Viewer::section(viewer.frame, 23);
    std::array<float, 3> x{};
    if (bytes.size() == 104)
      std::memcpy(x.data(), bytes.data() + offset, sizeof x);
    return Vector3(x[0], x[1], x[2]);
  };
  const auto has_blade = [&] { return !Viewer::section(viewer.frame, 23).empty(); };
  REQUIRE(viewer.until([&] { return !viewer.session.is_null(); }));
  CHECK(viewer.session["two_hands"] == true);
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 1; }));
  CHECK(viewer.errors[0]["code"] == "no_tool");
  viewer.say({{"type", "take"}});
  viewer.pose_second({0, -0.04, 0.03});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 2; }));
  CHECK(viewer.errors[1]["code"] == "unavailable");
  viewer.say({{"type", "record"}, {"on", true}});
  REQUIRE(viewer.until([&] { return !viewer.recording.is_null() && viewer.recording["on"] == true; }));
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && has_blade(); }));
  CHECK(watcher.until([&] { return !watcher.second.is_null() && watcher.second["on"] == true; }));
  viewer.pose({-0.012, 0, 0.035});
  viewer.pose({-0.012, 0, 0.028}); // the probe presses
  REQUIRE(viewer.until([&] { return viewer.vector(116).norm() > 0.01; }));
  const Vector3 pressing = viewer.vector(116);
  viewer.pose_second({0.012, -0.045, 0.018});
  REQUIRE(viewer.until([&] { return (blade(8) - Vector3(0.012, -0.045, 0.018)).norm() < 1e-4; }));
  viewer.pose_second({0.012, 0.02, 0.018});
  double resisted = 0; // N
  REQUIRE(viewer.until([&] {
    resisted = std::max(resisted, blade(48).norm());
    return viewer.value<float>(216) > 1e-4;
  }));
  CHECK(resisted > 0.01);
  CHECK(viewer.vector(116).norm() > 0.5 * pressing.norm()); // it has not moved
  CHECK(viewer.value<std::uint32_t>(48) == 0);              // and is the probe
  // A session that cannot be replaced goes on with both hands, and whoever asks again is told.
  viewer.second = nullptr;
  viewer.say({{"type", "set"}, {"coarse_spacing", 1e-4}, {"fine_spacing", 1e-3}});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 3 && !viewer.second.is_null(); }));
  CHECK(viewer.second["on"] == true);
  CHECK(has_blade());
  viewer.second = nullptr;
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return !viewer.second.is_null(); }));
  CHECK(viewer.second["on"] == true);
  // The blade into the first hand: the second has nothing then.
  viewer.say({{"type", "mode"}, {"mode", "blade"}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == false && !has_blade(); }));
  // And into the second again: the first has the probe.
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && viewer.mode["mode"] == "probe" && has_blade(); }));
  viewer.say({{"type", "record"}, {"on", false}});
  REQUIRE(viewer.until([&] { return viewer.recording["on"] == false; }));
  const std::string name = viewer.recording["name"];
  const ProgramResult again =
      run_spherecut({"haptics", "--replay", (served.folder().path() / "recordings" / name).string(), "--out",
                     (served.folder().path() / "again").string()});
  INFO(again.out << again.err);
  CHECK(again.status == 0);
  CHECK_THAT(again.out, Catch::Contains("both hands"));
  viewer.say({{"type", "replay"}, {"name", name}});
  REQUIRE(viewer.until([&] { return viewer.replay["on"] == true; }));
  CHECK(viewer.until([&] { return (viewer.value<std::uint32_t>(44) & 4U) != 0 && blade(48).norm() > 0.01; }));
  // Whoever holds the tool lays both away with it.
  viewer.say({{"type", "replay"}, {"name", nullptr}});
  REQUIRE(viewer.until([&] { return viewer.replay["on"] == false; }));
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && has_blade(); }));
  viewer.say({{"type", "release"}});
  CHECK(viewer.until([&] { return viewer.second["on"] == false && !has_blade(); }));
  CHECK(viewer.sound);
}

TEST_CASE("What lies beside the scenarios and recordings, and how much of it, stops no viewer") {
  const Served served;
  const auto& folder = served.folder().path();
  REQUIRE(mkfifo((folder / "pipe.toml").c_str(), 0600) == 0);
  std::filesystem::create_symlink("/dev/zero", folder / "endless.toml");
  std::filesystem::create_directory(folder / "folder.toml");
  write_file(folder / "long.toml", "# " + std::string(5'000'000, 'x'));
  const auto recordings = folder / "recordings";
  std::filesystem::create_directory(recordings);
  REQUIRE(mkfifo((recordings / "pipe.recording").c_str(), 0600) == 0);
  for (int i = 0; i < 4000; ++i)
    write_file(recordings / fmt::format("{:04}-{}.recording", i, std::string(200, 'n')), "");
  Viewer viewer(served.port());
  REQUIRE(viewer.until([&] { return !viewer.welcome.is_null(); }));
  const Json& welcome = viewer.welcome;
  std::vector<std::string> names;
  for (const Json& entry : welcome["scenarios"])
    names.push_back(entry["name"]);
  CHECK(names == std::vector<std::string>{"bad.toml", "live.toml", "long.toml"});
  CHECK(welcome["recordings"].size() >= 100);
  CHECK(welcome["recordings"].size() + welcome["recordings_left_out"].get<std::size_t>() == 4000);
  viewer.say({{"type", "take"}});
  for (const std::string name : {"pipe.toml", "endless.toml", "folder.toml", "../live.toml", "long.toml"}) {
    const std::size_t before = viewer.errors.size();
    viewer.say({{"type", "scenario"}, {"name", name}});
    REQUIRE(viewer.until([&] { return viewer.errors.size() > before; }));
    CHECK(viewer.errors.back()["code"] == "refused");
  }
  const std::size_t before = viewer.errors.size();
  viewer.say({{"type", "replay"}, {"name", "pipe.recording"}});
  CHECK(viewer.until([&] { return viewer.errors.size() > before; }));
}

TEST_CASE("A second server is refused the folder that another records into") {
  const Served first;
  const Served second(live_block, first.folder().path() / "recordings");
  Viewer one(first.port()), two(second.port());
  one.say({{"type", "take"}});
  two.say({{"type", "take"}});
  one.say({{"type", "record"}, {"on", true}});
  REQUIRE(one.until([&] { return !one.recording.is_null(); }));
  two.say({{"type", "record"}, {"on", true}});
  REQUIRE(two.until([&] { return !two.errors.empty(); }));
  CHECK_THAT(two.errors.back()["text"].get<std::string>(), Catch::Contains("another run writes into it"));
}

TEST_CASE("Serving with --open shows the page in the user's browser") {
  const TemporaryFolder folder;
  const std::filesystem::path opener =
      write_file(folder.path() / "xdg-open", "#!/bin/sh\nprintf %s \"$1\" > \"$0.url\"\n");
  std::filesystem::permissions(opener, std::filesystem::perms::owner_all);
  const ProgramResult ended =
      run_shell("PATH=" + folder.path().string() + ":$PATH timeout --foreground --preserve-status -s INT 2 " +
                spherecut_command({"serve", write_file(folder.path() / "live.toml", live_block).string(), "--port", "0",
                                   "--open", "--out", (folder.path() / "recordings").string()}));
  CHECK(ended.status == 0);
  std::string url;
  for (int i = 0; i < 1000 && url.empty(); ++i, std::this_thread::sleep_for(std::chrono::milliseconds(20)))
    if (std::filesystem::exists(folder.path() / "xdg-open.url"))
      url = read_file(folder.path() / "xdg-open.url");
  CHECK_THAT(url, Catch::StartsWith("http://127.0.0.1:"));
  CHECK_THAT(ended.out, Catch::Contains("serving at " + url));
}

TEST_CASE("Serving what cannot be served is refused in words, and Ctrl-C ends it cleanly") {
  const TemporaryFolder folder;
  const std::string scenario = write_file(folder.path() / "live.toml", live_block).string();
  WebServerOptions options;
  options.port = 0;
  const WebServer taken(options, {});
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& word) {
    const ProgramResult result = run_spherecut(arguments);
    CAPTURE(result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, Catch::Contains(word));
  };
  refused({"serve", scenario, "--port", std::to_string(taken.port())}, "in use");
  refused({"serve", scenario, "--port", "0", "--address", "nowhere"}, "not an IP address");
  refused({"serve", (folder.path() / "missing.toml").string(), "--port", "0"}, "missing.toml");
  refused({"serve", scenario, "--port", "0", "--page", (folder.path() / "none").string()}, "no such folder");
  const ProgramResult ended = run_shell(
      "timeout --foreground --preserve-status -s INT 2 " +
      spherecut_command({"serve", scenario, "--port", "0", "--out", (folder.path() / "recordings").string()}));
  CHECK(ended.status == 0);
  CHECK_THAT(ended.out, Catch::Contains("serving at http://127.0.0.1:") && Catch::Contains("ended"));
}
