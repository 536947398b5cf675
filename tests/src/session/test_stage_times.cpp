// The stages of an increment: parts of the time that has passed, whoever spent what is told of the body.
#include "src/tissue/cut_report.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

double told_sum(const RebuildSeconds& seconds) {
  return seconds.visibility + seconds.assembly + seconds.solve;
}

} // namespace

TEST_CASE("Sight and factorisation are parts of a stage's time, and what was spent beside it is not taken off it") {
  Session session = session_of(cut_block + disc_precut + "pressure = 100\n");
  run(session);
  const double factor = session.model().body->report().factor_seconds;
  REQUIRE(factor > 0);
  BodyUpdate whole; // all of it within the stage
  whole.seconds.assembly = 10 + factor;
  report_body(session.model(), 3, whole);
  CHECK(whole.seconds.visibility == 3);
  CHECK(whole.seconds.solve == Approx(factor).epsilon(1e-9));
  CHECK(whole.seconds.assembly == Approx(7).epsilon(1e-9));
  CHECK(whole.nodes == session.model().sprinkling.nodes.size());
  for (const double elapsed : {0.0, 0.5 * factor, 2.0}) { // less than what is told of sight, or of both
    BodyUpdate update;
    update.seconds.assembly = elapsed;
    report_body(session.model(), elapsed < 1 ? 0 : 3, update);
    CHECK(update.seconds.visibility >= 0);
    CHECK(update.seconds.solve >= 0);
    CHECK(update.seconds.assembly >= 0);
    CHECK(told_sum(update.seconds) == Approx(elapsed).margin(1e-12));
  }
}

TEST_CASE("No increment of a cut that only appends takes less than no time, though its uncut body was there before") {
  Session session = session_of(stretched(cut_block) + "[cut]\nsight = \"appended\"\n" +
                               replaced(incision_at_end, "-0.042, 0.001, 0.033", "0.002, 0.001, 0.033"));
  for (const StepResult& result : run(session)) {
    REQUIRE(result.cut);
    for (const double seconds :
         {result.cut->seconds.topology, result.cut->seconds.visibility, result.cut->seconds.sprinkling,
          result.cut->seconds.assembly, result.cut->seconds.solve})
      CHECK(seconds >= 0);
  }
}

TEST_CASE("The stages of a step are parts of its time, and one that did nothing took none") {
  Session session =
      session_of(stretched(small_scenario) + replaced(incision_at_end, "-0.042, 0.001, 0.033", "0.022, 0.001, 0.033"));
  for (const StepResult& result : run(session)) {
    const StageSeconds& of = result.stages;
    CHECK(of.contact > 0);
    CHECK(of.solve > 0);
    CHECK(of.force > 0);
    CHECK(of.tear == 0);
    for (const double seconds : {of.cut, of.body})
      CHECK(seconds >= 0);
    CHECK(of.contact + of.cut + of.body + of.solve + of.tear + of.force <= result.seconds);
  }
}
