// What a step of a session is made of, part by part.
#include "src/session/finite_stepper.hpp"
#include "src/session/step_report.hpp"
#include "src/session/tear_propagation.hpp"
#include "src/session/tool_following.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/tissue/tissue_parts.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

StepSample no_tool(double time) {
  return {time, std::nullopt, std::nullopt};
}

void build_and_solve(TissueParts& parts, const StepSample& sample) {
  parts.updater.build(parts.state.model);
  parts.contact.solve(sample, parts.state.model);
}

} // namespace

TEST_CASE("Fronts with more energy than they take tear until they have less, at the toughness of what is torn") {
  TissueParts parts(stretched_bar(0.15, 0.3, bar_notch));
  const TearFronts fronts(parts.state.scenario, parts.state.toughness, parts.state.zone.zone());
  TearPropagation tears(parts.state, parts.grasping, parts.contact, parts.background, parts.updater, fronts, nullptr);
  build_and_solve(parts, no_tool(0));
  const double before = parts.state.model.incision->area();
  StepResult result;
  result.cut.emplace();
  tears.tear(no_tool(0), {}, result);
  REQUIRE(result.tear);
  CHECK(result.tear->increments.size() > 1);
  CHECK(result.tear->area == Approx(parts.state.model.incision->area() - before).epsilon(1e-9));
  // Triangles with their middles beyond the bar's surface count for none.
  CHECK(result.tear->ledger.surface == Approx(0.3 * result.tear->area).epsilon(0.05));
  CHECK(result.cut->triangles > 0);
  StepResult again; // nothing has changed since
  again.cut.emplace();
  tears.tear(no_tool(1), {}, again);
  CHECK(again.tear->area == Approx(result.tear->area).epsilon(0.05));
}

TEST_CASE("A blade that is resisted leaves no mark where it is lifted before its cut is due") {
  TissueParts parts(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 20") +
                    blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.027]"}, 0.04, "0.1"));
  const TearFronts fronts(parts.state.scenario, parts.state.toughness, parts.state.zone.zone());
  ResistedBlade resisted(parts.state, parts.blade, parts.contact, parts.background, parts.updater, fronts);
  build_and_solve(parts, no_tool(0));
  const std::size_t half = parts.state.steps.size() / 2;
  for (std::size_t i = 0; i < half; ++i) {
    CutReport report;
    CHECK(resisted.press(parts.state.steps[i], report) == 0); // it cuts nothing yet
    parts.blade.arrive(parts.state.steps[i]);
  }
  CHECK(resisted.enters(parts.state.steps[half]));
  CHECK(resisted.force().report().force.z() > 0); // upwards, on the blade
  const VectorX without = parts.state.model.field.coefficients;
  resisted.load_body();
  REQUIRE(parts.state.model.without_blade);
  CHECK(parts.state.model.without_blade->coefficients == without);
  CHECK(parts.state.model.field.coefficients != without);
  resisted.lift();
  CHECK_FALSE(resisted.has_proposal());
  CHECK(resisted.force().report().force.norm() == 0);
  CHECK(parts.state.incisions->incision() == nullptr);
  CHECK(parts.state.wound() == &parts.state.incisions->wound());
}

TEST_CASE("The fine zone that follows the tool in the background becomes the one that follows it within them") {
  TissueParts waits(small_scenario), goes_on(small_scenario);
  for (TissueParts* parts : {&waits, &goes_on}) {
    parts->state.contact = parts->state.touch->contact;
    parts->updater.build(parts->state.model);
  }
  StepSample sample = waits.state.steps.back();
  sample.tool->point.x() += 0.005;
  topology::SurfaceContact centre = waits.state.query.first_touch(waits.state.scenario.tool->shape, *sample.tool);
  REQUIRE(waits.state.zone.must_follow(centre));
  for (TissueParts* parts : {&waits, &goes_on})
    parts->contact.solve(waits.state.steps.back(), parts->state.model);
  ToolFollowing within(waits.state, waits.contact, waits.updater, waits.background);
  StepResult result;
  within.follow(sample, centre, result);
  CHECK(result.resprinkled);
  CHECK(waits.state.rebuild == Rebuild::in_step);
  ToolFollowing beside(goes_on.state, goes_on.contact, goes_on.updater, goes_on.background);
  beside.follow_in_background(sample, centre);
  REQUIRE(goes_on.background.is_following());
  CHECK_FALSE(beside.has_taken());
  beside.take();
  CHECK(beside.has_taken());
  CHECK_FALSE(beside.has_taken());
  CHECK(goes_on.state.model.sprinkling.nodes.positions == waits.state.model.sprinkling.nodes.positions);
  CHECK(goes_on.state.zone.centre()->point == waits.state.zone.centre()->point);
}

TEST_CASE("A body at finite strain waits for the tool, and is there from its first touch on") {
  TissueParts parts(replaced(small_scenario, "poisson_ratio = 0.3", "poisson_ratio = 0.3\nlaw = \"neo_hookean\""));
  StepReport report(parts.state, parts.contact, parts.grasping);
  FiniteStepper stepper(parts.state, parts.contact);
  for (const StepSample& sample : parts.state.steps) {
    StepResult result;
    result.contact = parts.state.query.first_touch(parts.state.scenario.tool->shape, *sample.tool);
    parts.state.contact = result.contact;
    if (stepper.solve(sample, false, false))
      report.tell_finite(nullptr, result);
    CHECK((parts.state.model.finite != nullptr) == (result.contact.depth > 0));
    CHECK((result.force.z() > 0) == (result.contact.depth > 0));
  }
  CHECK(std::ssize(parts.state.node_states) == parts.state.model.sprinkling.nodes.size());
}
