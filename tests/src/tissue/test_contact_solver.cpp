// Contact and body without the steps of a session.
#include "src/session/blade_cutting.hpp"
#include "src/session/tear_fronts.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/tissue/tissue_parts.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

TEST_CASE("A body that is built and pressed by hand has the force of the session's step") {
  TissueParts parts(small_scenario);
  Session session = session_of(small_scenario);
  REQUIRE(parts.state.steps.size() == session.steps().size());
  Vector3 force = Vector3::Zero();
  for (const StepSample& sample : session.steps())
    force = session.step(sample).force;
  CHECK_FALSE(parts.contact.is_in_reach()); // nobody has said where the tool is
  const StepSample& last = parts.state.steps.back();
  parts.state.contact = parts.state.query.first_touch(parts.state.scenario.tool->shape, *last.tool);
  CHECK(parts.contact.is_in_reach());
  parts.updater.build(parts.state.model);
  parts.contact.begin_step();
  parts.contact.solve(last, parts.state.model);
  const solvers::ContactState& tool = parts.state.model.state->tool;
  CHECK((tool.tool_force - force).norm() < 1e-6 * force.norm());
  REQUIRE(parts.contact.penetration());
  CHECK(parts.contact.penetration()->deepest < 0.001);
}

TEST_CASE("A blade cuts what its edge sweeps, and its body follows with a front of its own") {
  TissueParts parts(cut_block + blade({"[0.02, 0, 0.04]", "[0.02, 0, 0.02]"}, 0.04, "0.5"));
  BladeCutting cutting(parts.state, parts.blade, parts.contact, parts.grasping, parts.background, parts.updater);
  for (const StepSample& sample : parts.state.steps) {
    CutReport report;
    parts.blade.begin_step(sample, {}, parts.state.zone.fine());
    cutting.move(sample, report);
    parts.blade.arrive(sample);
    CHECK_FALSE(report.refused);
  }
  REQUIRE(parts.state.model.incision != nullptr);
  CHECK(parts.state.model.incision->area() == Approx(0.06 * 0.01).epsilon(1e-3)); // through the width of the block
  CHECK(parts.state.model.solved());
  const TearFronts fronts(parts.state.scenario, parts.state.toughness, parts.state.zone.zone());
  CHECK(fronts.grow(parts.state.model, {}, 0.002).triangles > 0);
  CHECK(fronts.join(parts.state.model, {}).triangles == 0); // there is one front alone
}

TEST_CASE("A cut that is refused leaves the body that was there") {
  TissueParts parts(cut_block + by_appending + blade({"[0.02, 0, 0.04]", "[0.02, 0, 0.02]"}, 0.04, "0.5"));
  const StepSample& last = parts.state.steps.back();
  parts.updater.build(parts.state.model);
  parts.contact.solve({last.time, std::nullopt, std::nullopt}, parts.state.model);
  const solvers::Discretisation* const body = parts.state.model.body.get();
  parts.state.incisions->move_to(*parts.state.steps.front().blade, {});
  REQUIRE(parts.state.incisions->move_to(*last.blade, {}).triangles > 0);
  BodyModel next = parts.updater.next();
  CHECK(next.incision != nullptr);
  const VectorX before = body->nodal_displacements(body->solve());
  BodyUpdate update;
  parts.updater.build_cut({}, next, update);
  CHECK(update.update == SystemUpdate::updated);
  CHECK(next.body->coefficient_count() > body->coefficient_count());
  parts.state.incisions->take_back();
  CHECK(parts.updater.next().incision == nullptr);
  CHECK(parts.state.model.body.get() == body);
  CHECK(body->nodal_displacements(body->solve()) == before); // all bits
}
