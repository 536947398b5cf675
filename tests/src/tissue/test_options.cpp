// By which policy a body follows a blade, and what a session says.
#include "src/tissue/log.hpp"
#include "src/tissue/options.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

const std::string drawn = blade({"[0, 0, 0.04]", "[0, 0, 0.02]"}, 0.04, "0.5");
const std::string at_once = replaced(drawn, "step = 0.5", "step = 0.5\nadvance = 0");
const std::string tough_block = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10");

} // namespace

TEST_CASE("A body follows its blade in the step or beside it, as scenario and options say") {
  const SessionOptions off_line, beside{.following_in_background = true};
  const auto policies = [&](const std::string& text) {
    const Scenario scenario = scenario_of(text);
    return std::vector{cut_policy(scenario, off_line), cut_policy(scenario, beside)};
  };
  using enum CutPolicy;
  CHECK(policies(small_scenario) == std::vector{none, none});
  CHECK(policies(cut_block + drawn) == std::vector{in_step, in_background});
  CHECK(policies(cut_block + by_appending + drawn) == std::vector{in_step, in_background});
  CHECK(policies(cut_block + by_rebuilding + drawn) == std::vector{in_step, in_background});
  CHECK(policies(cut_block + by_rebuilding + at_once) == std::vector{in_step, in_step});
  CHECK(policies(cut_block + "[method]\nname = \"collocation\"\n" + drawn) == std::vector{in_step, in_background});
  CHECK(policies(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\nlaw = \"neo_hookean\"") + drawn) ==
        std::vector{in_step, in_background});
  CHECK(policies(tough_block + drawn) == std::vector{proposed, proposed_in_background});
  CHECK(policies(tough_block + at_once) == std::vector{proposed, proposed});
  CHECK(policies(tough_block + drawn + "[tearing]\n") == std::vector{proposed, proposed});
}

TEST_CASE("A blade goes half a spacing ahead of a body that is made in the background, else as far as it is told") {
  const Scenario usual = scenario_of(cut_block + by_rebuilding + drawn),
                 told = scenario_of(cut_block + by_rebuilding + at_once),
                 appended = scenario_of(cut_block + by_appending + drawn);
  CHECK(blade_advance(usual, {}) == 0);
  CHECK(blade_advance(usual, {.following_in_background = true}) == background_advance);
  CHECK(blade_advance(told, {.following_in_background = true}) == 0);
  CHECK(blade_advance(appended, {.following_in_background = true}) == background_advance);
}

TEST_CASE("What cuts, resists or loads is read off the scenario") {
  CHECK_FALSE(has_cuts(scenario_of(small_scenario)));
  CHECK(has_cuts(scenario_of(cut_block + disc_precut)));
  CHECK(has_cuts(scenario_of(cut_block + drawn)));
  CHECK_FALSE(resists(scenario_of(cut_block + drawn)));
  CHECK(resists(scenario_of(tough_block + drawn)));
  CHECK_FALSE(resists(scenario_of(tough_block + disc_precut))); // there is no blade
  CHECK_FALSE(has_loads(scenario_of(small_scenario)));
  CHECK(has_loads(scenario_of(small_scenario + "[gravity]\nacceleration = [0, 0, -9.81]\n")));
  CHECK_FALSE(has_grasper(scenario_of(small_scenario)));
}

TEST_CASE("A session warns once for each key, and says all else as often as it is told") {
  std::vector<std::string> said;
  SessionLog log([&](const std::string& text) { said.push_back(text); });
  log.say("nodes");
  log.warn("a", "first");
  log.warn("a", "second");
  log.warn("b", "third");
  log.say("nodes");
  CHECK(said == std::vector<std::string>{"nodes", "warning: first", "warning: third", "nodes"});
  CHECK(log.warnings() == std::vector<std::string>{"first", "third"});
}
