// Nodes that follow the tool in the background, fixed regions that keep theirs, and what a viewer is told of tears.
#include "src/live/haptic_report.hpp"
#include "src/live/tear_status.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

/// A ball that slides 16 mm over the block of small_scenario, in 12 steps.
const std::string slide = [] {
  const auto from = small_scenario.find("[tool.approach]");
  return replaced(small_scenario.substr(0, from), "step = 0.25", "step = 0.125") + R"(
[[tool.path]]
time = 0
position = [-0.008, 0, 0.031]
[[tool.path]]
time = 0.5
position = [-0.008, 0, 0.0285]
[[tool.path]]
time = 1.5
position = [0.008, 0, 0.0285]
[output]
figures = false
)";
}();

} // namespace

TEST_CASE("Nodes made in the background are those that a step would have made, and give the same force") {
  const Scenario scenario = scenario_of(slide);
  Session waits(scenario), goes_on(scenario);
  goes_on.set_options({.following_in_background = true});
  int followed = 0;
  for (const StepSample& sample : waits.steps()) {
    const bool follows = waits.step(sample).resprinkled;
    const auto before = goes_on.model().sprinkling.nodes.positions;
    CHECK_FALSE(goes_on.step(sample).resprinkled);
    REQUIRE(goes_on.pending().under_way == follows);
    if (!follows)
      continue;
    ++followed;
    CHECK(goes_on.model().sprinkling.nodes.positions == before); // the body as it was has gone on
    REQUIRE(goes_on.swap_body());
    CHECK_FALSE(goes_on.pending().under_way);
    CHECK(goes_on.model().sprinkling.nodes.positions == waits.model().sprinkling.nodes.positions);
    const StepResult here = waits.step(sample), there = goes_on.step(sample);
    CHECK(there.resprinkled);
    CHECK(here.force.norm() > 0.01);
    CHECK((there.force - here.force).norm() < 1e-6 * here.force.norm()); // one began from the solution before
  }
  CHECK(followed >= 2);
}

TEST_CASE("A tool that leaves the fine zone waits for the next one, and when its thread runs does not change a bit") {
  const Scenario scenario = scenario_of(slide);
  const auto run = [&](std::chrono::milliseconds pause, int& followed) {
    Session session(scenario);
    session.set_options({.following_in_background = true});
    std::vector<VectorX> fields;
    for (const StepSample& sample : session.steps()) {
      followed += session.step(sample).resprinkled ? 1 : 0;
      fields.push_back(session.model().field.coefficients);
      std::this_thread::sleep_for(pause);
    }
    return fields;
  };
  int quick = 0, slow = 0;
  const std::vector<VectorX> a = run(std::chrono::milliseconds(0), quick), b = run(std::chrono::milliseconds(40), slow);
  CHECK(quick >= 1);
  CHECK(slow == quick);
  CHECK(a == b);
}

TEST_CASE("In the loop nodes made beside it are taken over at the recorded solve, with the same bits") {
  const LoopRecords records = run_twice(scenario_of(slide), solves_in_background(1500, 50, 20), 1500);
  CHECK(std::count_if(records.solves.begin(), records.solves.end(),
                      [](const SolveRecord& solve) { return solve.resprinkled; }) >= 2);
}

TEST_CASE("The loop tells by how much the force changed when the nodes followed in a step") {
  const Scenario scenario = scenario_of(slide);
  const LoopRecords records = run_twice(scenario, regular_solves(1500, 50, 20), 1500);
  double largest = 0;
  for (const SolveRecord& solve : records.solves) {
    CHECK((solve.force_jump > 0) == solve.resprinkled);
    largest = std::max(largest, solve.force_jump);
  }
  REQUIRE(largest > 0);
  const HapticFindings findings = findings_of(HapticSettings{}, records, {});
  CHECK(findings.resprinkle_jump == largest);
  CHECK_THAT(text_of(findings), Contains("re-sprinkles (of the force by up to "));
}

TEST_CASE("A fixed region too small for coarser nodes keeps the node that it had") {
  Scenario scenario = scenario_of(small_scenario);
  const Session session(scenario);
  const solvers::NodeCloud& fine = session.model().sprinkling.nodes;
  solvers::SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = 0.02;
  const solvers::NodeCloud coarse = solvers::resprinkle(*session.organ().domain, options, fine).nodes;
  // A surface node that goes, and the largest ball about it that is left without one.
  int lost = -1;
  double radius = 0;
  for (int i = 0; i < fine.size(); ++i) {
    if (fine.kinds[i] != solvers::NodeKind::surface || fine.positions[i].z() < 0.01)
      continue;
    double nearest = 1;
    for (int k = 0; k < coarse.size(); ++k)
      if (on_surface(coarse.kinds[k]))
        nearest = std::min(nearest, (coarse.positions[k] - fine.positions[i]).norm());
    if (nearest > radius) {
      radius = nearest;
      lost = i;
    }
  }
  REQUIRE(radius > 0.002);
  FixedRegion suture;
  suture.name = "suture";
  suture.shape = SphereRegion{fine.positions[lost], 0.2 * radius};
  scenario.fixed.push_back(suture);
  CHECK_THROWS_AS(fixed_nodes(scenario, *session.organ().domain, coarse), InputError);
  const solvers::Sprinkling held = resprinkle_held(scenario, *session.organ().domain, options, fine);
  CHECK_NOTHROW(fixed_nodes(scenario, *session.organ().domain, held.nodes));
  CHECK(std::count(held.nodes.positions.begin(), held.nodes.positions.end(), fine.positions[lost]) == 1);
  CHECK(held.nodes.size() < fine.size()); // elsewhere they are coarser
  scenario.fixed.pop_back();
  CHECK(resprinkle_held(scenario, *session.organ().domain, options, fine).nodes.positions == coarse.positions);
}

TEST_CASE("A tear that goes on solve by solve is told as unstable, then that it has parted the body") {
  // A bar that is stretched between its ends, with a notch from one side: it runs away.
  Session session(scenario_of(stretched_bar(0.15, 0.05, bar_notch + "[tearing]\nstep = 1.0\n")));
  session.set_options({.tear_gradually = true});
  TearStatus status;
  bool unstable = false, severed = false;
  double area = 0;
  for (int i = 0; i < 12 && !severed; ++i) {
    status = tear_status(session.step(session.steps().front()), status);
    CHECK(status.area >= area);
    area = status.area;
    unstable = unstable || status.state == TearState::unstable;
    severed = status.state == TearState::severed;
    INFO(to_string(status.state) << ": " << status.reason);
    CHECK((status.state == TearState::growing || status.state == TearState::unstable || severed));
  }
  CHECK(unstable);
  CHECK(severed);
  status = tear_status(session.step(session.steps().front()), status);
  CHECK(status.state == TearState::severed); // it stays
  CHECK(to_string(status.state) == "severed");
}

TEST_CASE("What stops a tear is told in its words") {
  StepResult step;
  CHECK(tear_status(step, {}).state == TearState::none);
  step.tear.emplace();
  step.tear->increments.resize(1);
  step.tear->reason = "less is released than a tear takes";
  TearStatus status = tear_status(step, {});
  CHECK(status.state == TearState::intact);
  CHECK(status.reason == "less is released than a tear takes");
  step.tear->area = 1e-4;
  status = tear_status(step, status);
  CHECK(status.state == TearState::arrested);
  CHECK(status.area == 1e-4);
  step.tear->reason = "refused: the front is too near";
  status = tear_status(step, status);
  CHECK(status.state == TearState::refused);
  CHECK(status.reason == "the front is too near");
  step.tear->increments.resize(2);
  CHECK(tear_status(step, status).state == TearState::growing);
  step.tear->unstable = true;
  CHECK(tear_status(step, status).state == TearState::unstable);
  step.tear.reset(); // a step that has not solved leaves it as it was
  CHECK(tear_status(step, status).state == TearState::refused);
}
