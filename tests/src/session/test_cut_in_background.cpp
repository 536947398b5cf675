// A body that follows a cut which was put off in the background, taken over at a definite step.
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

namespace {

// A ball that holds a block down, and a blade that comes down beside it.
const std::string press = R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.05
[[tool.path]]
time = 0
position = [0.015, 0, 0.0305]
[[tool.path]]
time = 0.2
position = [0.015, 0, 0.0285]
[[tool.path]]
time = 1
position = [0.015, 0.001, 0.0285]
)";

std::string blade_through(const std::vector<std::string>& positions) {
  std::string text = "[blade]\nedge = [[0, -0.009, 0], [0, 0.009, 0.001]]\nstep = 0.05\nadvance = 0.4\n";
  for (std::size_t i = 0; i < positions.size(); ++i)
    text += fmt::format("[[blade.path]]\ntime = {}\nposition = {}\n",
                        static_cast<double>(i) / static_cast<double>(positions.size() - 1), positions[i]);
  return text;
}

const std::string pressed_and_cut = cut_block + by_rebuilding + press +
                                    blade_through({"[-0.02, 0.001, 0.034]", "[-0.022, 0, 0.012]"}) +
                                    "[output]\nfigures = false\n";

// In on a way that turns, out again, and in beside it.
const std::string in_and_out = cut_block + by_rebuilding +
                               blade_through({"[-0.004, 0, 0.034]", "[-0.004, 0, 0.022]", "[0.002, 0.001, 0.020]",
                                              "[0.003, 0, 0.036]", "[0.012, 0, 0.036]", "[0.012, 0, 0.021]"});

// Of a plain run, m2.
double cut_area(const Scenario& scenario) {
  Session session(scenario);
  return run(session).back().cut->area;
}

bool same_sheets(const Session& a, const Session& b) {
  return std::equal(a.model().incision->sheets().begin(), a.model().incision->sheets().end(),
                    b.model().incision->sheets().begin(), b.model().incision->sheets().end(),
                    [](const topology::SurfaceMesh& p, const topology::SurfaceMesh& q) {
                      return p.vertices == q.vertices && p.triangles == q.triangles;
                    });
}

// Cut area, m2, of a session that is solved at these ticks; how often a body was left under way.
double area_when_solved(const Scenario& scenario, bool in_background, const std::vector<std::uint64_t>& ticks,
                        int& beside) {
  HapticSimulation simulation(scenario);
  simulation.set_following_in_background(in_background);
  ScriptedPath device(simulation.path(), scenario.haptics.rate);
  ContactSnapshot snapshot;
  simulation.prepare(device.read(0));
  for (const std::uint64_t tick : ticks) {
    if (simulation.session().pending().under_way)
      simulation.swap_body();
    simulation.solve(device.read(tick), 0, snapshot);
    beside += simulation.session().pending().under_way ? 1 : 0;
  }
  CHECK_FALSE(simulation.session().pending().under_way);
  REQUIRE(simulation.session().model().incision != nullptr);
  return simulation.session().model().incision->area();
}

} // namespace

TEST_CASE("A body made in the background is the one that a step would have made, and gives the same force") {
  struct Case {
    std::string method;
    bool is_pressed, appends;
  };
  const auto [method, is_pressed, appends] =
      GENERATE(Case{"galerkin", true, false}, Case{"galerkin", false, false}, Case{"galerkin", true, true},
               Case{"galerkin", false, true}, Case{"collocation", true, false});
  const Scenario scenario = scenario_of(
      replaced(is_pressed ? pressed_and_cut : in_and_out, by_rebuilding, appends ? by_appending : by_rebuilding) +
      "[method]\nname = \"" + method + "\"\n");
  Session waits(scenario), goes_on(scenario);
  goes_on.set_options({.following_in_background = true});
  int followed = 0, nodes_here = 0, nodes_there = 0;
  bool is_same = true;
  double area = 0;
  for (const StepSample& sample : waits.steps()) {
    const bool cuts = waits.step(sample).cut->triangles > 0;
    const int nodes = goes_on.model().sprinkling.nodes.size();
    const bool is_built = goes_on.model().body != nullptr;
    const StepResult before = goes_on.step(sample);
    const bool is_last = sample.time == waits.steps().back().time; // what is left at the end is not put off
    REQUIRE(goes_on.pending().under_way == (cuts && is_built && !is_last));
    if (!goes_on.pending().under_way) {
      area = before.cut->area;
      continue;
    }
    ++followed;
    CHECK(before.cut->triangles == 0); // body, cut and wound as they were have gone on
    CHECK(before.cut->area == area);
    CHECK(goes_on.model().sprinkling.nodes.size() == nodes);
    REQUIRE(goes_on.swap_body());
    CHECK_FALSE(goes_on.pending().under_way);
    StepSample again = sample;
    again.time += 1e-6;
    again.blade->time = again.time;
    const StepResult here = waits.step(again), there = goes_on.step(again);
    // Where the tool presses, rounding of the blade's places at rest comes to decide between nodes that are as good.
    is_same = is_same && same_sheets(goes_on, waits);
    if (is_same)
      CHECK(goes_on.model().sprinkling.nodes.positions == waits.model().sprinkling.nodes.positions);
    CHECK(std::abs(there.nodes - here.nodes) <= 10); // of 680
    nodes_here += here.nodes;
    nodes_there += there.nodes;
    CHECK((is_same || (is_pressed && followed > 1)));
    CHECK(there.cut->triangles > 0);
    CHECK(there.cut->update == SystemUpdate::taken_over);
    CHECK(there.cut->has_grown == appends);
    CHECK(there.cut->nodes == there.nodes);
    CHECK(there.cut->area >= area);
    CHECK(there.cut->area == Approx(here.cut->area).epsilon(is_pressed ? 1e-4 : 1e-12));
    area = there.cut->area;
    if (!is_pressed)
      continue;
    CHECK(here.force.norm() > 0.05);
    CHECK((there.force - here.force).norm() <= (followed == 1 ? 1e-6 : 1e-4) * here.force.norm());
  }
  CHECK(followed >= 4);
  CHECK(nodes_there == Approx(nodes_here).epsilon(0.005)); // single bodies differ by up to seven nodes of 680
}

TEST_CASE("A blade that is too far ahead waits for its body, and when a thread runs does not change a bit") {
  const Scenario scenario =
      scenario_of(replaced(pressed_and_cut, by_rebuilding, GENERATE(by_rebuilding, by_appending)));
  const auto run = [&](std::chrono::milliseconds pause, int& followed, double& area) {
    Session session(scenario);
    session.set_options({.following_in_background = true});
    std::vector<VectorX> fields;
    for (const StepSample& sample : session.steps()) {
      const StepResult result = session.step(sample);
      CHECK_FALSE(result.cut->refused);
      followed += result.cut->update == SystemUpdate::taken_over ? 1 : 0;
      area = result.cut->area;
      fields.push_back(session.model().field.coefficients);
      std::this_thread::sleep_for(pause);
    }
    CHECK_FALSE(session.pending().under_way);
    return fields;
  };
  int quick = 0, slow = 0;
  double quick_area = 0, slow_area = 0;
  const std::vector<VectorX> a = run(std::chrono::milliseconds(0), quick, quick_area);
  const std::vector<VectorX> b = run(std::chrono::milliseconds(60), slow, slow_area);
  CHECK(quick >= 2);
  CHECK(slow == quick);
  CHECK(a == b);
  CHECK(quick_area == Approx(cut_area(scenario)).epsilon(2e-3)); // at its end the blade is where it was
}

TEST_CASE("A blade that leaves the tissue or is lifted while its body is under way has cut what it went through") {
  const Scenario scenario = scenario_of(in_and_out);
  const int swaps = GENERATE(0, 2, 5); // steps from the beginning of a body to where it takes over; 0: when waited for
  Session plain(scenario), background(scenario);
  background.set_options({.following_in_background = true});
  int under_way = 0, followed = 0;
  StepResult here, there;
  for (const StepSample& sample : plain.steps()) {
    here = plain.step(sample);
    there = background.step(sample);
    CHECK_FALSE(there.cut->refused);
    followed += there.cut->update == SystemUpdate::taken_over ? 1 : 0;
    CHECK(there.cut->area <= here.cut->area * (1 + 1e-3));
    under_way = background.pending().under_way ? under_way + 1 : 0;
    if (swaps > 0 && under_way >= swaps)
      CHECK(background.swap_body());
  }
  CHECK(followed >= 2);
  CHECK(there.cut->area == Approx(here.cut->area).epsilon(1e-3)); // the body is at rest, poses are the same there
  CHECK(there.cut->front_length == Approx(here.cut->front_length).epsilon(1e-3));
  CHECK(there.cut->sheets == here.cut->sheets);
}

TEST_CASE("A blade lifted by the hand, or no longer followed in the background, leaves the cut that was under way") {
  const bool lifts = GENERATE(true, false);
  const Scenario scenario = scenario_of(in_and_out);
  Session session(scenario);
  session.set_options({.following_in_background = true});
  std::size_t i = 0;
  while (i < session.steps().size() && !session.pending().under_way)
    session.step(session.steps()[i++]);
  REQUIRE(session.pending().under_way);
  const double before = session.model().incision == nullptr ? 0 : session.model().incision->area();
  if (lifts)
    session.lift_blade();
  else
    session.set_options({.following_in_background = false});
  const StepResult result = session.step(session.steps()[i]);
  CHECK_FALSE(session.pending().under_way);
  CHECK(result.cut->triangles > 0);
  CHECK(result.cut->area > before);
  CHECK(session.model().incision->area() == result.cut->area);
}

TEST_CASE("What was put off is cut when the blade is lifted or gone") {
  const bool in_background = GENERATE(true, false), is_gone = GENERATE(true, false);
  const int poses = GENERATE(3, 65);
  Session session(scenario_of(in_and_out));
  session.set_options({.following_in_background = in_background});
  std::size_t i = 0;
  while (session.model().incision == nullptr)
    session.step(session.steps()[i++]);
  StepSample sample = session.steps()[i - 1];
  const double before = session.model().incision->area();
  for (int k = 0; k < poses; ++k) {
    sample.time += 1e-4;
    sample.blade->time = sample.time;
    sample.blade->position.z() -= 1e-3 / poses;
    CHECK(session.step(sample).cut->triangles == 0);
  }
  CHECK(session.model().incision->area() == before);
  CHECK_FALSE(session.pending().under_way);
  if (is_gone)
    sample.blade.reset();
  else
    session.lift_blade();
  StepResult result;
  for (int k = 0; k < 3; ++k) {
    sample.time += 1e-4;
    if (sample.blade)
      sample.blade->time = sample.time;
    result = session.step(sample);
    CHECK_FALSE(result.cut->refused);
    if (session.pending().under_way) {
      CHECK(in_background);
      CHECK(session.swap_body());
    }
  }
  CHECK(session.warnings().empty());
  CHECK(result.cut->area > before + 0.9 * 0.018e-3);
}

TEST_CASE("Beside the steps a cut is put off by half a spacing unless the scenario says how far, and not at all at 0") {
  const std::string left_out = replaced(pressed_and_cut, "advance = 0.4\n", "");
  const auto increments = [](const std::string& text, bool in_background, int& beside) {
    Session session(scenario_of(text));
    session.set_options({.following_in_background = in_background});
    int count = 0;
    beside = 0;
    for (const StepSample& sample : session.steps()) {
      count += session.step(sample).cut->triangles > 0 ? 1 : 0;
      beside += session.pending().under_way ? 1 : 0;
      if (session.pending().under_way)
        CHECK(session.swap_body());
    }
    return count;
  };
  int beside = 0;
  const int every = increments(left_out, false, beside);
  CHECK(beside == 0);
  CHECK(every >= 12);
  CHECK(increments(replaced(left_out, "step = 0.05\n[[blade", "step = 0.05\nadvance = 0\n[[blade"), true, beside) ==
        every);
  CHECK(beside == 0);
  const int some = increments(left_out, true, beside);
  CHECK(beside >= 3);
  CHECK(2 * some <= every);
}

TEST_CASE("A blade that comes to rest is followed to where it is") {
  Session session(scenario_of(pressed_and_cut));
  session.set_options({.following_in_background = true});
  std::size_t i = 0;
  while (session.model().incision == nullptr) {
    session.step(session.steps()[i++]);
    if (session.pending().under_way)
      CHECK(session.swap_body());
  }
  StepSample sample = session.steps()[i];
  sample.blade->position.z() -= 1e-4;
  session.step(sample);
  REQUIRE(session.pending().put_off);
  CHECK(session.pending().lags);
  const double area = session.model().incision->area();
  int steps = 0;
  for (; session.pending().put_off && steps < 50; ++steps) {
    sample.time += 0.005;
    sample.blade->time = sample.time;
    session.step(sample);
  }
  CHECK(steps >= 15); // a tenth of a second
  CHECK(steps <= 25);
  REQUIRE(session.pending().under_way);
  CHECK(session.pending().lags);
  CHECK(session.swap_body());
  sample.time += 0.005;
  sample.blade->time = sample.time;
  CHECK(session.step(sample).cut->area > area);
  CHECK_FALSE(session.pending().lags);
  CHECK_FALSE(session.pending().put_off);
}

TEST_CASE("What is made in the background in time makes no nodes coarser, and early it makes them finer again") {
  DegradationRule rule(0.01);
  rule.solved(Rebuild::none, 1);
  rule.solved(Rebuild::in_background, 1);
  rule.solved(Rebuild::in_background_early, 1);
  CHECK(rule.level() == 0);
  rule.solved(Rebuild::in_step, 0.3); // the blade was too far ahead: it waited
  CHECK(rule.level() == 1);
  for (int i = 0; i < 7; ++i)
    rule.solved(Rebuild::in_background_early, 0.3);
  rule.solved(Rebuild::in_background, 0.3);
  CHECK(rule.level() == 1);
  for (int i = 0; i < 8; ++i)
    rule.solved(Rebuild::in_background_early, 0.3);
  CHECK(rule.level() == 0);
}

TEST_CASE("A scripted blade cuts to the end of its way however seldom it is solved, in real time in the background") {
  const bool in_background = GENERATE(true, false);
  const Scenario scenario = scenario_of(pressed_and_cut);
  int beside = 0;
  // 1000: the end of its way
  const double area =
      area_when_solved(scenario, in_background, {0, 100, 200, 450, 1000, 1300, 1310, 1320, 1330}, beside);
  CHECK((beside >= 2) == in_background);
  CHECK(area == Approx(cut_area(scenario)).epsilon(0.01));
}

TEST_CASE("A scripted blade that is past the end of its way at the next solve has cut to there") {
  const Scenario scenario = scenario_of(pressed_and_cut);
  int beside = 0;
  const double area = area_when_solved(scenario, true, {0, 200, 400, 1400, 1410, 1420, 1430, 1440}, beside);
  CHECK(area == Approx(cut_area(scenario)).epsilon(0.01));
}

TEST_CASE("A step tells what it had to do with a body that was made anew") {
  Session session(scenario_of(pressed_and_cut));
  session.set_options({.following_in_background = true});
  int early = 0, late = 0, in_step = 0, steps = 0;
  for (const StepSample& sample : session.steps()) {
    const Rebuild rebuild = session.step(sample).rebuild;
    early += rebuild == Rebuild::in_background_early ? 1 : 0;
    late += rebuild == Rebuild::in_background ? 1 : 0;
    in_step += rebuild == Rebuild::in_step ? 1 : 0;
    steps = session.pending().under_way ? steps + 1 : 0;
    if (steps == (early == 0 ? 1 : late == 0 ? 4 : 50)) // at once, later, and not before it has to wait
      session.swap_body();
  }
  CHECK(early >= 1);
  CHECK(late >= 1);
  CHECK(in_step >= 1);
}

TEST_CASE("While the blade moves fields of the contact are not made for a body that will soon be another") {
  Session session(scenario_of(replaced(pressed_and_cut, "advance = 0.4", "advance = 1")));
  session.set_options({.force_only = true});
  StepSample sample = *std::find_if(session.steps().begin(), session.steps().end(), [&](const StepSample& s) {
    session.step(s);
    return session.model().incision != nullptr;
  });
  const auto press_on = [&](double way) {
    for (int i = 0; i < few_presses + 15; ++i) {
      sample.time += 0.01;
      sample.blade->time = sample.time;
      sample.blade->position.z() -= way;
      session.step(sample);
    }
    return session.model().patch.responses.size();
  };
  CHECK(press_on(1e-6) == 0);
  CHECK(press_on(0) > 0);
}

TEST_CASE(
    "In the loop a body that followed its cut in the background takes over at the recorded solve, with the same bits") {
  const LoopRecords records = run_twice(scenario_of(pressed_and_cut), solves_in_background(1000, 40, 20), 1000);
  CHECK(std::count_if(records.solves.begin(), records.solves.end(),
                      [](const SolveRecord& solve) { return solve.update == "taken over"; }) >= 3);
}
