// What a blade that the tissue resists proposes to cut, made in the background.
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

constexpr double toughness = 10; // J/m2

// An upright edge, 12 mm of it in the tissue, that goes through a corner of a block of 60 mm: 20 mm of way in 0.25 s.
// The last of the corner bends away.
const std::string through_a_corner = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                                     R"([blade]
edge = [[0, 0, 0], [0, 0, 0.016]]
step = 0.01
[[blade.path]]
time = 0
position = [0.012, -0.034, 0.018]
[[blade.path]]
time = 0.4
position = [0.034, -0.012, 0.018]
)";

// Steps beside which bodies are made; each is there at the third step after it was begun. `look` sees every step.
void go(Session& session, const std::function<void(const StepResult&)>& look) {
  session.set_options({.following_in_background = true});
  int since = 0;
  for (const StepSample& sample : session.steps()) {
    since = session.pending().under_way ? since + 1 : 0;
    if (since == 3)
      session.swap_body();
    look(session.step(sample));
  }
}

} // namespace

TEST_CASE("A resisted blade whose cuts are made in the background waits at the force of steady cutting and cuts all") {
  const bool is_linear = GENERATE(true, false);
  INFO(is_linear);
  const Scenario scenario =
      scenario_of(is_linear ? through_a_corner
                            : replaced(through_a_corner, "toughness = 10", "law = \"neo_hookean\"\ntoughness = 10"));
  const double allowed = is_linear ? 1e-4 : 0.03; // at finite strain it waits where small motions lead to
  Session in_step(scenario);
  const double area = run(in_step).back().cut->area;
  REQUIRE(area > 0.75 * 0.012 * 0.0198);

  Session background(scenario);
  int waited = 0, taken = 0, in_the_step = 0;
  double shown = 0, last = 0, force = 0;
  std::uint64_t hash = 0;
  StepResult end;
  go(background, [&](const StepResult& step) {
    CHECK_FALSE(step.cut->refused);
    CHECK(step.cut->area >= last);
    taken += step.rebuild == Rebuild::in_background ? 1 : 0;
    in_the_step += step.rebuild == Rebuild::in_step ? 1 : 0;
    if (background.pending().under_way && step.cut->area > 0) { // what is shown and felt is the body that is there
      ++waited;
      if (step.cut->area == shown)
        CHECK(step.cut->surface_hash == hash);
      shown = step.cut->area;
      hash = step.cut->surface_hash;
      CHECK(step.cut->blade.release <= std::max(toughness, force) * (1 + allowed)); // it does not rise
      CHECK(background.pending().lags == background.blade()->lags());
      CHECK((background.blade()->lags() || step.cut->blade.release <= toughness * (1 + allowed)));
    }
    last = step.cut->area;
    force = step.cut->blade.release;
    end = step;
  });
  CHECK(waited > 5);
  CHECK(taken > 4);
  CHECK(in_the_step <= 2); // when it leaves
  CHECK_FALSE(background.pending().under_way);
  CHECK(end.cut->area == Approx(area).epsilon(0.02));
  CHECK(end.cut->pieces == 1);
  const solvers::BladeLedger& ledger = end.cut->blade.ledger;
  CHECK(ledger.surface == Approx(toughness * end.cut->area).epsilon(1e-9));
  CHECK(ledger.imbalance() < 0.02);
  CHECK(end.cut->blade.force.norm() == 0);
}

TEST_CASE("A blade whose first cut is long in the making waits for it, and nothing is lost") {
  const Scenario scenario = scenario_of(through_a_corner);
  Session in_step(scenario);
  const double area = run(in_step).back().cut->area;
  Session background(scenario);
  background.set_options({.following_in_background = true});
  int waited = 0;
  StepResult end;
  for (const StepSample& sample : background.steps()) { // bodies are taken where the blade has got too far ahead
    end = background.step(sample);
    if (end.cut->area > 0 || !background.pending().under_way)
      continue;
    waited += background.blade()->lags() ? 1 : 0;
    CHECK(end.cut->blade.release <= 2.4 * toughness * (1 + 1e-4));
  }
  CHECK(waited >= 2);
  CHECK(end.cut->area == Approx(area).epsilon(0.05));
  const solvers::BladeLedger& ledger = end.cut->blade.ledger;
  CHECK(ledger.surface == Approx(toughness * end.cut->area).epsilon(1e-9));
  CHECK(ledger.imbalance() < 0.02);
}

TEST_CASE("A session whose resisted blade is followed in the background comes out the same twice") {
  const LoopRecords records = run_twice(scenario_of(through_a_corner), solves_in_background(400, 10, 10), 400);
  CHECK(records.solves.back().cut_area > 1e-4);
  CHECK(std::count_if(records.solves.begin(), records.solves.end(),
                      [](const SolveRecord& solve) { return solve.update == "taken over"; }) > 4);
}

TEST_CASE("A proposal under way is dropped with the blade, or where steps are to make it again") {
  const Scenario scenario = scenario_of(through_a_corner);
  const bool is_lifted = GENERATE(true, false);
  Session session(scenario);
  session.set_options({.following_in_background = true});
  std::size_t i = 0;
  double area = 0;
  for (; i < session.steps().size() && !(session.pending().under_way && area > 0); ++i) {
    if (session.pending().under_way)
      session.swap_body();
    area = session.step(session.steps()[i]).cut->area;
  }
  REQUIRE(i < session.steps().size());
  const std::uint64_t hash = topology::surface_hash(session.wound()->surface);
  if (is_lifted)
    session.lift_blade();
  else
    session.set_options({.following_in_background = false});
  CHECK_FALSE(session.pending().under_way);
  CHECK_FALSE(session.swap_body());
  CHECK(topology::surface_hash(session.wound()->surface) == hash);
  CHECK(session.model().incision->area() == area);
  StepResult step;
  for (; i < session.steps().size(); ++i)
    step = session.step(session.steps()[i]);
  CHECK_FALSE(step.cut->refused);
  if (!is_lifted)
    CHECK(step.cut->area > 0.75 * 0.012 * 0.0198);
}

TEST_CASE("A resisted blade that is left in the tissue still cuts what it has come to") {
  const Scenario scenario = scenario_of(through_a_corner);
  Session session(scenario);
  session.set_options({.going_on = true, .following_in_background = true});
  double area = 0;
  std::optional<StepSample> last;
  for (const StepSample& sample : session.steps()) {
    if (session.pending().under_way && sample.time < 0.15)
      session.swap_body();
    area = session.step(sample).cut->area;
    last = sample;
    if (area > 0 && session.pending().under_way && session.pending().lags && sample.time > 0.2)
      break;
  }
  REQUIRE(session.pending().under_way);
  REQUIRE(session.pending().lags);
  const double left_at = last->time;
  last->blade.reset();
  int steps = 0, begun_later = 0;
  for (; steps < 20 && session.pending().lags; ++steps) {
    if (session.pending().under_way)
      session.swap_body();
    CHECK_FALSE(session.pending().there); // it is taken once
    last->time += 0.01;
    const StepResult step = session.step(*last);
    CHECK_FALSE(step.cut->refused);
    CHECK(step.cut->area >= area);
    area = step.cut->area;
    CHECK(session.pending().put_off ==
          (session.pending().lags && !session.pending().under_way)); // else nobody asks for it
    begun_later += session.pending().put_off ? 1 : 0;
  }
  CHECK(begun_later > 0);
  CHECK(steps > 0);
  CHECK(steps < 20);
  Session in_step(scenario);
  double reached = 0;
  for (const StepSample& sample : in_step.steps())
    if (sample.time <= left_at)
      reached = in_step.step(sample).cut->area;
  CHECK(area > 0.9 * reached);
}

TEST_CASE("With blade.advance = 0 a resisted blade's cuts are made in the steps") {
  Session session = session_of(replaced(through_a_corner, "step = 0.01", "step = 0.04\nadvance = 0"));
  int cuts = 0;
  go(session, [&](const StepResult& step) {
    CHECK_FALSE(session.pending().under_way);
    cuts += step.rebuild == Rebuild::in_step ? 1 : 0;
  });
  CHECK(cuts > 2);
}
