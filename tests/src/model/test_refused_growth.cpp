// Increments of a cut that fail once their body is there, appended to the one before or made anew. What fails is
// condensing the body: the program is linked with app::condense wrapped (tests/CMakeLists.txt).
#include "solvers/appended/appended_body.hpp"
#include "src/session/session.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

namespace spherecut::app {

namespace {
int failing_condensations = 0; // of those to come, the first
}

void condense_wrapped(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) asm(
    "__wrap__ZN9spherecut3app8condenseERKSt6vectorIiSaIiEERNS0_9BodyModelEb");
void condense_itself(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) asm(
    "__real__ZN9spherecut3app8condenseERKSt6vectorIiSaIiEERNS0_9BodyModelEb");

void condense_wrapped(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) {
  if (failing_condensations > 0) {
    --failing_condensations;
    throw NumericalError("not condensed");
  }
  condense_itself(candidates, model, for_few_presses);
}

} // namespace spherecut::app

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

/// Everything that a refused increment must leave as it was.
struct Before {
  explicit Before(const Session& session)
      : nodes(session.model().sprinkling.nodes.positions), reaches(session.model().sprinkling.nodes.reaches),
        moved(session.model().nodal_displacements()),
        area(session.model().incision == nullptr ? 0 : session.model().incision->area()),
        segments(session.zone().spacing.segments) {}

  void require_in(const Session& session) const {
    CHECK(session.model().sprinkling.nodes.positions == nodes);
    CHECK(session.model().sprinkling.nodes.reaches == reaches);
    const VectorX now = session.model().nodal_displacements();
    REQUIRE(now.size() == moved.size());
    CHECK((now - moved).norm() <= 1e-9 * moved.norm());
    CHECK((session.model().incision == nullptr ? 0 : session.model().incision->area()) == area);
    CHECK(session.zone().spacing.segments == segments);
    CHECK(session.wound()->pieces.size() == 1);
  }

  std::vector<Vector3> nodes;
  std::vector<double> reaches; // m
  VectorX moved;               // m
  double area;
  std::vector<std::array<Vector3, 2>> segments;
};

bool appends(const Session& session) {
  return dynamic_cast<const solvers::AppendedBody*>(session.model().body.get()) != nullptr;
}

/// m; how far the ends of the segments lie from others at most.
double farthest_end(const std::vector<std::array<Vector3, 2>>& segments,
                    const std::vector<std::array<Vector3, 2>>& others) {
  double farthest = 0;
  for (const std::array<Vector3, 2>& segment : segments)
    for (const Vector3& end : segment) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const auto& [from, to] : others) {
        const double share = std::clamp((end - from).dot(to - from) / (to - from).squaredNorm(), 0.0, 1.0);
        nearest = std::min(nearest, (end - from - share * (to - from)).norm());
      }
      farthest = std::max(farthest, nearest);
    }
  return farthest;
}

std::string tearing_bar(const std::string& cut) {
  return long_bar(0.15, 0.3, growing_notch(cut));
}

} // namespace

TEST_CASE("An increment of a tear that fails once its body is there leaves one in balance, and is made then") {
  const std::string cut =
      GENERATE(as<std::string>(), by_appending, by_rebuilding, by_rebuilding + "[method]\nname = \"collocation\"\n");
  Session session = session_of(tearing_bar(cut));
  session.set_options({.tear_gradually = true});
  const StepSample& sample = session.steps().front();
  for (int step = 0; step < 2; ++step)
    session.step(sample);
  const bool follows = cut == by_appending;
  REQUIRE(appends(session) == follows);
  const Before before(session);
  const solvers::Discretisation* const body = session.model().body.get();
  failing_condensations = 1;
  const StepResult refused = session.step(sample);
  CHECK(failing_condensations == 0);
  CHECK(refused.tear->reason == "refused: not condensed");
  CHECK(refused.tear->increments.size() == 1);
  CHECK(session.model().body.get() == body);
  CHECK(appends(session) == follows);
  CHECK(refused.residual < 1e-9);
  before.require_in(session);
  const StepResult next = session.step(sample);
  REQUIRE(next.tear->increments.size() == 2);
  CHECK(next.tear->increments.back().body.update == (follows ? SystemUpdate::updated : SystemUpdate::rebuilt));
  CHECK(next.residual < 1e-9);
}

TEST_CASE("Increments of a tear that are refused once each leave the fine zone's way to it") {
  Session session = session_of(tearing_bar(by_appending));
  session.set_options({.tear_gradually = true});
  Session undisturbed = session_of(tearing_bar(by_appending));
  undisturbed.set_options({.tear_gradually = true});
  const StepSample& sample = session.steps().front();
  for (Session* each : {&session, &undisturbed})
    each->step(sample);
  int left = 0;
  for (int step = 0; step < 6; ++step) {
    const Before before(session);
    failing_condensations = 1;
    CHECK(session.step(sample).tear->reason == "refused: not condensed");
    before.require_in(session);
    const BodyUpdate update = session.step(sample).tear->increments.back().body;
    const BodyUpdate expected = undisturbed.step(sample).tear->increments.back().body;
    if (expected.update == SystemUpdate::rebuilt) {
      CHECK(update.update_reason == expected.update_reason);
      left += expected.update_reason == "the front has left the fine zone" ? 1 : 0;
    }
    // How many pieces the fine zone's way is told in is a matter of rounding; where it runs is not.
    const auto &way = session.zone().spacing.segments, &expected_way = undisturbed.zone().spacing.segments;
    REQUIRE_FALSE(way.empty());
    REQUIRE_FALSE(expected_way.empty());
    CHECK(std::max(farthest_end(way, expected_way), farthest_end(expected_way, way)) <
          0.005 * session.zone().spacing.fine);
  }
  CHECK(left >= 1);
}

TEST_CASE("A blade's cut that fails once the body has followed it leaves a body in balance and reports no nodes") {
  Session session = session_of(long_block + by_appending + incision_at_end);
  std::size_t i = 0;
  for (; i < 4; ++i)
    session.step(session.steps()[i]);
  REQUIRE(appends(session));
  const Before before(session);
  failing_condensations = 1;
  const StepResult refused = session.step(session.steps()[i]);
  CHECK(failing_condensations == 0);
  REQUIRE(refused.cut->refused);
  CHECK(refused.cut->update == SystemUpdate::none);
  CHECK(refused.cut->kept_nodes == 0);
  CHECK(refused.cut->nodes == session.model().sprinkling.nodes.size());
  CHECK(refused.residual < 1e-9);
  before.require_in(session);
}

TEST_CASE("A resisted blade's cut that is refused reports no nodes") {
  Session session = session_of(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                               R"([cut]
front_spacing = 0.004
[blade]
edge = [[0, -0.04, 0], [0, 0.04, 0]]
step = 0.25
[[blade.path]]
time = 0
position = [0.004, 0, 0.031]
[[blade.path]]
time = 1
position = [0.003, 0, 0.012]
)");
  session.prepare(session.steps().front());
  for (const StepSample& sample : session.steps()) {
    failing_condensations = 1000; // however often a shorter or a longer cut is tried within the step
    const StepResult result = session.step(sample);
    if (!result.cut->refused)
      continue;
    CHECK(result.cut->reason == "not condensed");
    CHECK(result.cut->update == SystemUpdate::none);
    CHECK(result.cut->update_reason.empty());
    CHECK(result.cut->kept_nodes == 0);
    CHECK(result.cut->triangles == 0);
    failing_condensations = 0;
    return;
  }
  FAIL("no cut was refused");
}

TEST_CASE("A cut whose body cannot be made in the background is refused, and the next one makes up for it") {
  const std::string text =
      cut_block + by_rebuilding + replaced(incision_at_end, "step = 0.2", "step = 0.05\nadvance = 0.3");
  const Scenario scenario = scenario_of(replaced(replaced(text, "-0.042", "-0.012"), "-0.043", "-0.013"));
  Session plain(scenario), session(scenario);
  session.set_options({.following_in_background = true});
  std::size_t i = 0;
  const auto go_until_it_cuts = [&] {
    while (i + 1 < session.steps().size() && !session.pending().under_way)
      session.step(session.steps()[i++]);
    REQUIRE(session.pending().under_way);
  };
  go_until_it_cuts();
  REQUIRE(session.swap_body());
  CHECK(session.step(session.steps()[i++]).cut->triangles > 0);
  const Before before(session);
  const std::size_t triangles = session.wound()->surface.triangles.size();
  failing_condensations = 2; // on exchanged nodes, and on nodes made anew
  go_until_it_cuts();
  CHECK_FALSE(session.swap_body());
  CHECK(failing_condensations == 0);
  CHECK_FALSE(session.pending().under_way);
  CHECK(session.model().sprinkling.nodes.positions == before.nodes);
  CHECK(session.wound()->surface.triangles.size() == triangles);
  const StepResult refused = session.step(session.steps()[i++]);
  CHECK(refused.cut->refused);
  CHECK(refused.cut->triangles == 0);
  CHECK_THAT(refused.cut->reason, Contains("not condensed"));
  CHECK(refused.cut->area == before.area);
  failing_condensations = 1;
  go_until_it_cuts();
  CHECK(session.swap_body());
  const StepResult made = session.step(session.steps()[i++]);
  CHECK(made.cut->triangles > 0);
  CHECK(made.cut->update_reason == "not condensed"); // why all nodes were made anew
  StepResult last, as_plain;
  for (; i < session.steps().size(); ++i)
    last = session.step(session.steps()[i]);
  for (const StepSample& sample : plain.steps())
    as_plain = plain.step(sample);
  CHECK(last.cut->area > before.area);
  CHECK(last.cut->area == Approx(as_plain.cut->area).epsilon(1e-3));
}
