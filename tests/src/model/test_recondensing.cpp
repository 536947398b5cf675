// A body condensed anew in the background and taken over at a definite step.
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

// A stretched bar that is cut at one end in many small increments, so that a window does not last.
const std::string bar =
    replaced(replaced(replaced(replaced(cut_block, "0.06, 0.06, 0.03]", "0.24, 0.03, 0.03]"), "0.005", "0.004"),
                      "0.012", "0.01"),
             "poisson_ratio = 0.3", "poisson_ratio = 0.3\npretension = [0.05, 0, 0]") +
    by_window + R"([blade]
edge = [[0, -0.006, 0], [0, 0.006, 0.001]]
step = 0.125
[[blade.path]]
time = 0
position = [-0.042, 0.001, 0.033]
[[blade.path]]
time = 1
position = [-0.043, 0.001, 0.010]
)";

std::unique_ptr<solvers::Discretisation> rebuilt_from_scratch(const Session& session) {
  solvers::DiscretisationOptions method = session.scenario().method;
  method.unheld = session.scenario().cut.unheld;
  return solvers::discretise(session.model().body->problem(), method);
}

/// Coefficients after every step; the body that is under way is taken over before every second step that could.
std::vector<VectorX> run(Session& session, bool early, std::chrono::milliseconds pause, int& taken) {
  std::vector<VectorX> fields;
  int under_way = 0;
  for (const StepSample& sample : session.steps()) {
    under_way += session.pending().under_way ? 1 : 0;
    if (early && session.pending().under_way && under_way % 2 == 0)
      taken += session.swap_body() ? 1 : 0;
    const StepResult result = session.step(sample);
    CHECK_FALSE(result.cut->refused);
    CHECK(result.residual < 1e-9);
    taken += result.cut->update == SystemUpdate::taken_over ? 1 : 0;
    fields.push_back(session.model().field.coefficients);
    std::this_thread::sleep_for(pause);
  }
  return fields;
}

} // namespace

TEST_CASE("A body that takes over from the background is the one built from scratch, and follows what is cut later") {
  const std::string text = bar + "[method]\nname = \"" + GENERATE("galerkin", "collocation") + "\"\n";
  Session session(scenario_of(text));
  session.set_options({.recondensing = true});
  int taken = 0, followed = 0;
  for (const StepSample& sample : session.steps()) {
    const StepResult result = session.step(sample);
    CHECK(result.residual < 1e-9);
    followed += result.cut->update == SystemUpdate::updated || result.cut->update == SystemUpdate::taken_over ? 1 : 0;
    if (!session.pending().under_way)
      continue;
    const solvers::Field before = session.model().body->solve();
    REQUIRE(session.swap_body()); // nothing has been cut since it was begun
    ++taken;
    CHECK_FALSE(session.pending().under_way);
    CHECK_FALSE(session.swap_body());
    const solvers::Field now = session.model().body->solve(), scratch = rebuilt_from_scratch(session)->solve();
    CHECK((now.coefficients - scratch.coefficients).norm() <= 1e-9 * scratch.coefficients.norm());
    CHECK((now.coefficients - before.coefficients).norm() < 2e-3 * scratch.coefficients.norm()); // finer cells
  }
  CHECK(taken >= 1);
  CHECK(followed >= 3);
  REQUIRE(session.model().incision != nullptr);
  Session rebuilt(scenario_of(text));
  for (const StepSample& sample : rebuilt.steps())
    rebuilt.step(sample);
  CHECK(session.model().incision->area() == Approx(rebuilt.model().incision->area()).epsilon(2e-3));
}

TEST_CASE("A cut during condensing is repeated on the new body, and when a thread runs does not change a bit") {
  const bool early = GENERATE(false, true);
  // In short steps the new body follows several of them in one, and the rest of them where it is taken over.
  const std::string text = replaced(bar, "step = 0.125", GENERATE("step = 0.125", "step = 0.03125"));
  int taken = 0, taken_slowly = 0;
  Session quick(scenario_of(text)), slow(scenario_of(text));
  quick.set_options({.recondensing = true});
  slow.set_options({.recondensing = true});
  const std::vector<VectorX> a = run(quick, early, std::chrono::milliseconds(0), taken);
  const std::vector<VectorX> b = run(slow, early, std::chrono::milliseconds(60), taken_slowly);
  CHECK(taken >= 1);
  CHECK(taken == taken_slowly);
  CHECK(a == b);
  // It has followed: its nodes are those of the session, and it is near to a body built anew on them.
  const solvers::Field now = quick.model().body->solve(), scratch = rebuilt_from_scratch(quick)->solve();
  CHECK(quick.model().body->problem().nodes.positions == quick.model().sprinkling.nodes.positions);
  CHECK((now.coefficients - scratch.coefficients).norm() < 2e-3 * scratch.coefficients.norm());
}

TEST_CASE("What is condensed in the background and given up leaves no trace, at any moment") {
  Session plain(scenario_of(bar)), other(scenario_of(bar));
  for (const StepSample& sample : plain.steps()) {
    plain.step(sample);
    other.set_options({.recondensing = true});
    other.step(sample);
    other.set_options({.recondensing = false}); // in the middle of it
    CHECK_FALSE(other.pending().under_way);
  }
  CHECK(other.model().field.coefficients == plain.model().field.coefficients);
  Session left(scenario_of(bar));
  left.set_options({.recondensing = true});
  bool begun = false;
  for (std::size_t i = 0; i < left.steps().size() && !begun; ++i) {
    left.step(left.steps()[i]);
    begun = left.pending().under_way;
  }
  CHECK(begun); // and the session ends while it runs
}

TEST_CASE("In the loop a body from the background is taken over at the recorded solve, with the same bits") {
  std::vector<SolveEvent> events = regular_solves(1000, 125, 20);
  for (std::size_t i = 3; i < events.size(); i += 2)
    events[i].swaps = true;
  const LoopRecords records = run_twice(scenario_of(bar), events, 1000);
  CHECK(std::count_if(records.solves.begin(), records.solves.end(),
                      [](const SolveRecord& solve) { return !solve.update.empty(); }) >= 3);
}

TEST_CASE("A session that is made ready has a body that follows the first cut") {
  const std::string text = replaced(bar, "step = 0.125", "step = 0.125\nadvance = 0");
  Session ready(scenario_of(text)), other(scenario_of(text));
  std::vector<SystemUpdate> first;
  for (Session* session : {&ready, &other}) {
    session->set_options({.recondensing = session == &ready});
    session->prepare(session->steps().front());
    CHECK_FALSE(session->pending().under_way); // it is there
    first.push_back(SystemUpdate::none);
    for (std::size_t i = 0; i < session->steps().size() && first.back() == SystemUpdate::none; ++i)
      first.back() = session->step(session->steps()[i]).cut->update;
  }
  CHECK(first == std::vector{SystemUpdate::updated, SystemUpdate::rebuilt});
  const solvers::Field now = ready.model().body->solve(), scratch = rebuilt_from_scratch(ready)->solve();
  CHECK((now.coefficients - scratch.coefficients).norm() < 2e-3 * scratch.coefficients.norm());
}
