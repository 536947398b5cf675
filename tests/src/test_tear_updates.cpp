// Bodies that follow the increments of a tear by updates, as they follow a blade.
#include "src/session.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fmt/format.h>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

const std::string notch = R"([[precut]]
shape = "rectangle"
centre = [0.0007, -0.008, 0.005]
normal = [1, 0.03, 0.02]
up = [0, 1, 0]
width = 0.02
height = 0.009
)";

/// A long bar whose front, across its middle, concerns a small part of its nodes.
std::string long_bar(double strain, double toughness, const std::string& more) {
  std::string text = stretched_bar(strain, toughness, more);
  text = replaced(replaced(replaced(text, "0.04, 0.016", "0.11, 0.016"), "-0.0199", "-0.0549"), "0.0199", "0.0549");
  return replaced(text, "coarse_spacing = 0.005", "coarse_spacing = 0.0034");
}

std::string growing(const std::string& method) {
  return notch + "[method]\nname = \"" + method + "\"\n[tearing]\nstep = 0.4\n";
}

/// The last increment of a tear in a step that makes one at most.
TearIncrement increment_of(const StepResult& result) {
  INFO(result.tear->reason);
  REQUIRE(result.tear->increments.size() == 2);
  return result.tear->increments.back();
}

/// The solution on the same nodes and cells, with all that an update takes over computed anew. Without tool.
VectorX from_scratch(const Session& session) {
  const auto* growing = dynamic_cast<const solvers::GrowingBody*>(session.body());
  if (growing == nullptr) {
    solvers::DiscretisationOptions method = session.scenario().method;
    method.unheld = session.scenario().cut.unheld;
    return solvers::discretise(session.body()->problem(), method)->solve().coefficients;
  }
  const VectorX all = growing->system().from_scratch({}).coefficients;
  const std::vector<char>& removed = growing->system().removed();
  std::vector<double> present;
  for (std::size_t i = 0; i < removed.size(); ++i)
    for (int c = 0; c < 3 && removed[i] == 0; ++c)
      present.push_back(all[3 * static_cast<Eigen::Index>(i) + c]);
  return Eigen::Map<const VectorX>(present.data(), std::ssize(present));
}

int count(const std::vector<TearIncrement>& increments, SystemUpdate update) {
  return static_cast<int>(std::count_if(increments.begin(), increments.end(), [&](const TearIncrement& increment) {
    return increment.number > 0 && increment.body.update == update;
  }));
}

} // namespace

TEST_CASE("An increment of a tear that is updated gives fields and intensities of the body built from scratch") {
  const std::string method = GENERATE("galerkin", "collocation");
  Session session(scenario_of(long_bar(0.15, 0.3, growing(method))));
  session.set_tear_gradually(true); // as in the loop in real time
  session.set_force_only(true);
  int updated = 0, rebuilt = 0;
  for (int step = 0; step < 6; ++step) {
    const TearIncrement increment = increment_of(session.step(session.steps().front()));
    const BodyUpdate& body = increment.body;
    INFO(to_string(body.update) << ": " << body.update_reason);
    CHECK(body.nodes == session.sprinkling().nodes.size());
    CHECK(session.body()->problem().nodes.positions == session.sprinkling().nodes.positions);
    if (body.update == SystemUpdate::rebuilt) {
      ++rebuilt;
      CHECK((body.update_reason == "the fine zone had nothing of the way ahead" ||
             body.update_reason == "the front has left the fine zone"));
      continue;
    }
    REQUIRE(body.update == SystemUpdate::updated);
    CHECK(body.update_reason.empty());
    CHECK(body.kept_nodes > 0.95 * body.nodes);
    ++updated;
    solvers::Field expected = session.field();
    expected.coefficients = from_scratch(session);
    CHECK((session.field().coefficients - expected.coefficients).norm() < 1e-8 * expected.coefficients.norm());
    const auto tough = [](const Vector3&) { return 1.0; };
    const double fine = session.zone().spacing.fine;
    const auto followed = solvers::front_states(*session.body(), session.field(), tough, fine);
    const auto anew = solvers::front_states(*session.body(), expected, tough, fine);
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
    Session session(scenario_of(long_bar(0.15, 0.3, growing("galerkin") + "most_increments = 3\n")));
    session.set_updating(updating);
    return *session.step(session.steps().front()).tear;
  };
  const TearReport updated = torn(true), rebuilt = torn(false);
  CHECK(count(updated.increments, SystemUpdate::updated) == 2);
  CHECK(count(rebuilt.increments, SystemUpdate::rebuilt) == 3);
  REQUIRE(updated.increments.size() == rebuilt.increments.size());
  // A rebuild has finer cells at the front as it is now.
  for (std::size_t k = 0; k < rebuilt.increments.size(); ++k)
    CHECK(updated.increments[k].release == Approx(rebuilt.increments[k].release).epsilon(0.02));
  CHECK(updated.area == Approx(rebuilt.area).epsilon(5e-3));
}

TEST_CASE("A tear that concerns most of a body rebuilds it at every increment, and says so") {
  Session session(scenario_of(stretched_bar(0.15, 0.05, bar_notch + "[tearing]\nmost_increments = 2\n")));
  const StepResult result = session.step(session.steps().front());
  REQUIRE(result.tear->increments.size() == 3);
  for (std::size_t k = 1; k < 3; ++k) {
    CHECK(result.tear->increments[k].body.update == SystemUpdate::rebuilt);
    CHECK(result.tear->increments[k].body.update_reason == "the cut concerns too much of the body");
  }
}

TEST_CASE("A refused increment of a tear leaves a body that has followed the ones before as it was") {
  // Held at one end alone and opened by pressure in the notch: the last increment parts it, which is not allowed.
  const std::string right_end = "[[fixed]]\nregion = \"half_space\"\npoint = [0.0549, 0, 0]\nnormal = [-1, 0, 0]\n";
  Session session(scenario_of(
      replaced(long_bar(0, 0.002, notch + "pressure = 300\n[cut]\nunheld = \"refuse\"\n[tearing]\n"), right_end, "")));
  session.set_tear_gradually(true);
  int updated = 0;
  bool last_updated = false;
  StepResult result;
  VectorX coefficients;
  std::vector<Vector3> nodes;
  double area = 0;
  for (int step = 0; step < 40; ++step) {
    if (session.body() != nullptr) {
      coefficients = session.field().coefficients;
      nodes = session.sprinkling().nodes.positions;
      area = session.incision()->area();
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
  CHECK(session.sprinkling().nodes.positions == nodes);
  CHECK((session.field().coefficients - coefficients).norm() < 1e-9 * coefficients.norm());
  CHECK(session.incision()->area() == area);
  CHECK(session.wound()->pieces.size() == 1);
  const StepResult again = session.step(session.steps().front());
  CHECK(again.tear->reason == result.tear->reason);
  CHECK((session.field().coefficients - coefficients).norm() < 1e-9 * coefficients.norm());
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
  Session session(scenario_of(long_bar(0.04, 0.3, blade + "[tearing]\nstep = 0.4\nmost_increments = 4\n")));
  int updated = 0, by_blade = 0;
  double torn = 0;
  for (const StepResult& result : run(session)) {
    if (result.cut->update != SystemUpdate::none) {
      ++by_blade;
      CHECK(result.cut->update_reason == "the blade is resisted");
    }
    updated += count(result.tear->increments, SystemUpdate::updated);
    torn = result.tear->area;
  }
  CHECK(by_blade >= 1);
  CHECK(torn > 1e-5);
  CHECK(updated >= 2);
}
