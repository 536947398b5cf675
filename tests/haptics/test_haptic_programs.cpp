// `spherecut haptics` with an Inverse3, against a stand-in for its service, and its bench.
#include "tests/support/haply_service.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace spherecut::tests;

namespace {

// A punch that waits half a millimetre above a block.
std::string scenario(const std::string& address) {
  return R"(title = "Inverse3"
[organ]
shape = "block"
size = [0.06, 0.06, 0.03]
[material]
young_modulus = 10000.0
poisson_ratio = 0.3
[[fixed]]
name = "base"
region = "box"
lower = [-0.04, -0.04, -0.001]
upper = [0.04, 0.04, 0.001]
[nodes]
fine_spacing = 0.005
coarse_spacing = 0.010
fine_radius = 0.012
[tool]
shape = "flat_punch"
radius = 0.006
length = 0.03
step = 0.1
[tool.approach]
target = [0.0, 0.0, 0.03]
direction = [0.0, 0.0, -1.0]
depth = 0.003
clearance = 0.0005
duration = 1.0
[haptics]
device = "haply"
[haptics.haply]
address = ")" +
         address + "\"\n";
}

ProgramResult feel(const TemporaryFolder& folder, const std::string& address, const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {
      "haptics",        write_file(folder.path() / "s.toml", scenario(address)).string(),
      "--solved-every", "0",
      "--out",          (folder.path() / "out").string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_spherecut(arguments);
}

long lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

} // namespace

TEST_CASE("A hand on an Inverse3 presses into a block and is told the force") {
  const TemporaryFolder folder;
  HaplyService service;
  service.set_fall(1e-6, 0.05); // on and on: how long the program prepares does not matter
  const ProgramResult result = feel(folder, service.address(), {"--duration", "3"});
  INFO(result.out + result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.out, Catch::Contains("Inverse3 049D at " + service.address()));
  const auto json = nlohmann::json::parse(read_file(folder.path() / "out" / "haptic.json"));
  CHECK(json["haply"]["poses"] > 100);
  CHECK(json["haply"]["garbage"] == 0);
  CHECK(json["haply"]["connected_again"] == 0);
  CHECK(json["peak_force_N"] > 0.05);
  CHECK(service.peak() > 0.05);
  CHECK(service.peak() <= json["peak_force_N"].get<double>() + 1e-9); // nothing that the loop has not limited
  CHECK(service.force() == HaplyService::Vector{0, 0, 0});
  CHECK(service.refused() == 0);
}

TEST_CASE("A session goes on without the service of its Inverse3, without force, and says so") {
  const TemporaryFolder folder;
  HaplyService service;
  service.close_after(400);
  const ProgramResult result = feel(folder, service.address(), {"--duration", "3"});
  INFO(result.out + result.err);
  CHECK(result.status == 0);
  CHECK_THAT(result.out,
             Catch::Contains("haply: the service at " + service.address() + " has gone: the force goes to zero"));
}

TEST_CASE("Without a service, with a bad address and in virtual time a session with an Inverse3 does not begin") {
  const TemporaryFolder folder;
  const std::string nobody = "ws://127.0.0.1:" + std::to_string(free_port());
  const ProgramResult absent = feel(folder, nobody, {});
  CHECK(absent.status == 2);
  CHECK_THAT(absent.err, Catch::Contains("\"" + nobody + "\": no Inverse service answers there"));
  CHECK(lines(absent.err) == 1);
  const ProgramResult bad = feel(folder, "localhost", {});
  CHECK(bad.status == 2);
  CHECK_THAT(bad.err, Catch::Contains("haptics.haply.address = \"localhost\"") && Catch::Contains("ws://HOST:PORT"));
  CHECK(lines(bad.err) == 1);
  const ProgramResult still = feel(folder, nobody, {"--virtual"});
  CHECK(still.status == 2);
  CHECK_THAT(still.err, Catch::Contains("haptics.device = \"haply\" cannot follow virtual time"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "out"));
}

TEST_CASE("The bench of a simulated hand gives the figures of four manoeuvres, the same every time") {
  const TemporaryFolder folder;
  const auto bench = [&](const std::string& out) {
    const ProgramResult result = run_spherecut({"haptics", "--bench", "--out", (folder.path() / out).string()});
    INFO(result.out + result.err);
    REQUIRE(result.status == 0);
    CHECK_THAT(result.out,
               Catch::Contains("device hand") && Catch::Contains("rise ms") && Catch::Contains("jerk m/s3"));
    return read_file(folder.path() / out / "haptic_bench.json");
  };
  const std::string first = bench("one");
  CHECK(bench("two") == first);
  const auto json = nlohmann::json::parse(first);
  CHECK(json["device"] == "hand");
  const auto& manoeuvres = json["manoeuvres"];
  for (const char* name : {"press", "slide", "cut"}) {
    INFO(name);
    CHECK(manoeuvres[name]["settled_N"] > 0.01);
    CHECK(manoeuvres[name]["rise_s"] > 1e-3);
    CHECK(manoeuvres[name]["overshoot"] >= 0);
    CHECK(manoeuvres[name]["oscillation_N"].is_number());
    CHECK(manoeuvres[name]["jerk_m_per_s3"] > 0);
  }
  CHECK(manoeuvres["tap"]["settled_N"].is_null());
  CHECK(manoeuvres["tap"]["peak_N"] > 0.1);
  for (const auto& manoeuvre : manoeuvres) // a hand of 300 N/m at a controlled device: next to nothing is given
    CHECK(manoeuvre["injected_J"] < 1e-4);
}

TEST_CASE("The bench takes its device from a scenario, and refuses what has no hand") {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const auto with = [&](const std::string& device) {
    std::string text = scenario("ws://127.0.0.1:" + std::to_string(free_port()));
    text.replace(text.find("\"haply\""), 7, device);
    return run_spherecut({"haptics", write_file(folder.path() / "s.toml", text).string(), "--bench", "--out", out});
  };
  const ProgramResult recorded = with("\"recording\"\nrecording = \"a.recording\"");
  CHECK(recorded.status == 2);
  CHECK_THAT(recorded.err, Catch::Contains("allowed: hand, script, bridge, haply"));
  const ProgramResult absent = with("\"haply\"");
  CHECK(absent.status == 2);
  CHECK_THAT(absent.err, Catch::Contains("no Inverse service answers there"));
}
