// Bodies that follow the increments of a tear by what these append, as they follow a blade.
#include "src/session/session.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

/// The last increment of a tear in a step that makes one at most.
TearIncrement increment_of(const StepResult& result) {
  INFO(result.tear->reason);
  REQUIRE(result.tear->increments.size() == 2);
  return result.tear->increments.back();
}

int count(const std::vector<TearIncrement>& increments, SystemUpdate update) {
  return static_cast<int>(std::count_if(increments.begin(), increments.end(), [&](const TearIncrement& increment) {
    return increment.number > 0 && increment.body.update == update;
  }));
}

} // namespace

TEST_CASE("An increment of a tear that is updated gives fields and intensities of the body built from scratch") {
  Session session(scenario_of(long_bar(0.15, 0.3, growing_notch(by_appending))));
  session.set_options({.force_only = true, .tear_gradually = true}); // as in the loop in real time
  int updated = 0, rebuilt = 0;
  for (int step = 0; step < 6; ++step) {
    const TearIncrement increment = increment_of(session.step(session.steps().front()));
    const BodyUpdate& update = increment.body;
    const BodyModel& model = session.model();
    INFO(to_string(update.update) << ": " << update.update_reason);
    CHECK(update.nodes == model.sprinkling.nodes.size());
    CHECK(model.body->problem().nodes.positions == model.sprinkling.nodes.positions);
    if (update.update == SystemUpdate::rebuilt) {
      ++rebuilt;
      CHECK((update.update_reason == "the fine zone had nothing of the way ahead" ||
             update.update_reason == "the front has left the fine zone"));
      continue;
    }
    REQUIRE(update.update == SystemUpdate::updated);
    CHECK(update.update_reason.empty());
    CHECK(update.kept_nodes > 0.95 * update.nodes);
    ++updated;
    solvers::DiscretisationOptions method = session.scenario().method;
    method.sight = solvers::SightRule::appended;
    method.tip_functions = false;
    const auto scratch = solvers::discretise(model.body->problem(), method);
    const solvers::Field expected = scratch->solve();
    const VectorX moved = model.nodal_displacements(), expected_moved = scratch->nodal_displacements(expected);
    CHECK((moved - expected_moved).norm() < 1e-8 * expected_moved.norm());
    const auto tough = [](const Vector3&) { return 1.0; };
    const double fine = session.zone().spacing.fine;
    const auto followed = solvers::front_states(*model.body, model.field, tough, fine);
    const auto anew = solvers::front_states(*scratch, expected, tough, fine);
    REQUIRE(followed.size() == anew.size());
    REQUIRE_FALSE(followed.empty());
    for (std::size_t k = 0; k < anew.size(); ++k)
      CHECK((followed[k].intensities - anew[k].intensities).norm() < 1e-8 * anew[k].intensities.norm());
  }
  CHECK(updated >= 3);
  CHECK(rebuilt >= 1); // the first
}

TEST_CASE("A tear whose systems are updated goes the way of one that rebuilds them") {
  const auto torn = [](bool updating) {
    Session session(scenario_of(long_bar(0.15, 0.3, growing_notch(by_appending) + "most_increments = 3\n")));
    session.set_options({.updating = updating});
    return *session.step(session.steps().front()).tear;
  };
  const TearReport updated = torn(true), rebuilt = torn(false);
  CHECK(count(updated.increments, SystemUpdate::updated) == 2);
  CHECK(count(rebuilt.increments, SystemUpdate::rebuilt) == 3);
  REQUIRE(updated.increments.size() == rebuilt.increments.size());
  for (std::size_t k = 0; k < rebuilt.increments.size(); ++k)
    CHECK(updated.increments[k].release == Approx(rebuilt.increments[k].release).epsilon(1e-5));
  CHECK(updated.area == Approx(rebuilt.area).epsilon(1e-6));
}

TEST_CASE("A tear to which nothing is appended rebuilds its body at every increment, and says so") {
  Session session(
      scenario_of(stretched_bar(0.15, 0.05, bar_notch + by_rebuilding + "[tearing]\nmost_increments = 2\n")));
  const StepResult result = session.step(session.steps().front());
  REQUIRE(result.tear->increments.size() == 3);
  for (std::size_t k = 1; k < 3; ++k) {
    CHECK(result.tear->increments[k].body.update == SystemUpdate::rebuilt);
    CHECK(result.tear->increments[k].body.update_reason == "nodes go along with the front");
  }
}

TEST_CASE("A refused increment of a tear leaves a body that has followed the ones before as it was") {
  // Held at one end alone and opened by pressure in the notch: the last increment parts it, which is not allowed.
  const std::string right_end = "[[fixed]]\nregion = \"half_space\"\npoint = [0.0549, 0, 0]\nnormal = [-1, 0, 0]\n";
  Session session(scenario_of(replaced(
      long_bar(0, 0.002,
               shallow_notch + "pressure = 300\n[cut]\nsight = \"appended\"\nunheld = \"refuse\"\n[tearing]\n"),
      right_end, "")));
  session.set_options({.tear_gradually = true});
  int updated = 0;
  bool last_updated = false;
  StepResult result;
  VectorX coefficients;
  std::vector<Vector3> nodes;
  double area = 0;
  for (int step = 0; step < 40; ++step) {
    if (session.model().body != nullptr) {
      coefficients = session.model().field.coefficients;
      nodes = session.model().sprinkling.nodes.positions;
      area = session.model().incision->area();
    }
    result = session.step(session.steps().front());
    if (result.tear->increments.size() < 2)
      break;
    last_updated = result.tear->increments.back().body.update == SystemUpdate::updated;
    updated += last_updated ? 1 : 0;
  }
  INFO(result.tear->reason);
  CHECK(updated >= 2);
  REQUIRE(result.tear->reason.starts_with("refused: "));
  CHECK(session.model().sprinkling.nodes.positions == nodes);
  CHECK((session.model().field.coefficients - coefficients).norm() < 1e-9 * coefficients.norm());
  CHECK(session.model().incision->area() == area);
  CHECK(session.wound()->pieces.size() == 1);
  const StepResult again = session.step(session.steps().front());
  CHECK(again.tear->reason == result.tear->reason);
  CHECK((session.model().field.coefficients - coefficients).norm() < 1e-9 * coefficients.norm());
}

TEST_CASE("A blade starts a cut that tears on, and the body follows the tear by updates") {
  const std::string blade = R"([blade]
edge = [[0, 0, -0.004], [0, 0, 0.014]]
step = 0.25
[[blade.path]]
time = 0
position = [0.0007, -0.012, 0]
[[blade.path]]
time = 1
position = [0.0009, -0.0015, 0]
)";
  Session session(
      scenario_of(long_bar(0.04, 0.3, blade + by_appending + "[tearing]\nstep = 0.4\nmost_increments = 4\n")));
  int updated = 0, by_blade = 0;
  double torn = 0;
  std::string first_reason;
  for (const StepResult& result : run(session)) {
    if (result.cut->update != SystemUpdate::none) {
      ++by_blade;
      CHECK((result.cut->update == SystemUpdate::updated || result.cut->update_reason == "the first cut"));
    }
    updated += count(result.tear->increments, SystemUpdate::updated);
    torn = result.tear->area;
    if (first_reason.empty() && result.tear->increments.size() > 1)
      first_reason = result.tear->increments[1].body.update_reason;
  }
  CHECK(first_reason == "the fine zone had nothing of the way ahead"); // it is about the blade's way
  CHECK(by_blade >= 1);
  CHECK(torn > 1e-5);
  CHECK(updated >= 2);
}
