// A blade that tissue at finite strain resists: its force against the energies and against the linear law, what it
// cuts, and the account of its work.
#include "src/model/finite_model.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

std::string tough_block(const std::string& law, const std::string& toughness) {
  return replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\n" + law + "toughness = " + toughness);
}

const std::string neo_hookean = "law = \"neo_hookean\"\n", fine_fronts = "[cut]\nfront_spacing = 0.004\n";

/// The middle of an edge along y, pressed down by `depth` m into the top of a block 0.03 m high.
struct Pressed {
  double force = 0, stiffness = 0, driving = 0; // N; N/m; J
};
Pressed press(FiniteModel& model, double depth, const solvers::BladePatch& free) {
  solvers::BladePatch patch = free;
  model.press_edge(VectorX::Constant(1, depth), 0, patch);
  const solvers::BladeState state = solvers::push_blade(patch, VectorX::Constant(1, depth));
  return {state.forces[0], 1 / patch.compliance(0, 0), state.driving};
}

} // namespace

TEST_CASE("The force of an edge on tissue at finite strain is the slope of the energy that it puts there") {
  Session session =
      session_of(tough_block(neo_hookean, "1e4") + blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.029]"}, 0.04, "0.5"));
  run(session);
  FiniteModel& model = *session.model().finite;
  model.leave_edge();
  const VectorX rest = model.coefficients();
  const solvers::EdgeContact contact{
      .point = {0.004, 0, 0.03}, .push = {0, 0, -1}, .normal = {1, 0, 0}, .length = 0.02};
  const solvers::BladePatch free = model.edge_patch({contact}, 0.003, {});
  const double step = 5e-4;
  double energy = 0, before = 0;
  for (const double depth : {2e-3, 4e-3, 6e-3}) { // to a fifth of the block
    INFO(depth);
    const Pressed less = press(model, depth - step, free), here = press(model, depth, free),
                  more = press(model, depth + step, free);
    CHECK((more.driving - less.driving) / (2 * step) == Approx(here.force).epsilon(2e-3));
    CHECK(here.driving > energy);
    CHECK(here.force > before);
    // Small motions about it.
    CHECK((more.force - less.force) / (2 * step) == Approx(here.stiffness).epsilon(0.1));
    energy = here.driving;
    before = here.force;
  }
  CHECK(press(model, -step, free).force == 0);
  // All else tells of the body without blade.
  CHECK(model.coefficients() == rest);
  model.show_pressed(true);
  CHECK(model.coefficients() == model.pressed_coefficients());
  press(model, 4e-3, free);
  CHECK((model.coefficients() - rest).norm() > 1e-3);
  model.leave_edge();
  CHECK(model.coefficients() == rest);
}

TEST_CASE("Where it strains little, a blade cuts neo-Hookean tissue as it does linear tissue") {
  const std::string way = fine_fronts + blade({"[0.004, 0, 0.031]", "[0.003, 0, 0.018]"}, 0.04, "0.125");
  Session linear = session_of(tough_block("", "0.1") + way),
          nonlinear = session_of(tough_block(neo_hookean, "0.1") + way);
  const std::vector<StepResult> one = run(linear), other = run(nonlinear);
  REQUIRE(one.size() == other.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    const CutReport &a = *one[k].cut, &b = *other[k].cut;
    CHECK(b.area == Approx(a.area).epsilon(0.01));
    CHECK(b.blade.ledger.work == Approx(a.blade.ledger.work).epsilon(0.03));
    CHECK(b.blade.ledger.imbalance() < a.blade.ledger.imbalance() + 0.01);
  }
  CHECK(other.back().cut->area > 0.06 * 0.01);
}

TEST_CASE("A blade dents tough neo-Hookean tissue, cuts it at toughness times width, and its work is accounted for") {
  const double toughness = 10, width = 0.06; // J/m2; m, of the block
  Session session = session_of(tough_block(neo_hookean, "10") + fine_fronts +
                               blade({"[0.004, 0, 0.031]", "[0.003, 0, 0.015]"}, 0.04, "0.04"));
  const std::vector<StepResult> results = run(session);
  double area = 0, sum = 0;
  int steady = 0;
  for (const StepResult& result : results) {
    const BladeReport& blade = result.cut->blade;
    CHECK(result.cut->area >= area); // and it lags behind the blade
    area = result.cut->area;
    if (area == 0) // what the blade does is in the tissue
      CHECK(blade.ledger.stored == Approx(blade.ledger.work).epsilon(5e-3).margin(2e-6));
    CHECK(blade.ledger.surface == Approx(toughness * area).epsilon(1e-9));
    if (area > 0)
      CHECK(blade.ledger.imbalance() < 1e-3);
    if (area > 0.3 * width * 0.015) {
      sum += blade.force.z();
      ++steady;
    }
  }
  REQUIRE(steady > 2);
  CHECK(sum / steady == Approx(toughness * width).epsilon(0.25)); // it stops and starts
  CHECK(session.model().incision->front_length() == Approx(width).epsilon(0.01));
  // The tissue is shown as the blade deforms it.
  const BladeReport& last = results.back().cut->blade;
  CHECK(session.model().at({0.003, 0, 0.014}).displacement.z() < -0.1 * last.advance);
}

TEST_CASE("A blade that dents neo-Hookean tissue and is drawn back leaves nothing behind") {
  Session session = session_of(tough_block(neo_hookean, "200") +
                               blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.026]", "[0.004, 0, 0.035]"}, 0.04, "0.25"));
  const std::vector<StepResult> results = run(session);
  CHECK(session.model().incision == nullptr);
  double most = 0;
  for (const StepResult& result : results)
    most = std::max(most, result.cut->blade.force.z());
  CHECK(most > 0.1);
  CHECK(results.back().cut->blade.force.norm() == 0);
  CHECK(session.model().at({0.004, 0, 0.029}).displacement.norm() < 1e-6);
  CHECK(results.back().cut->blade.ledger.imbalance() < 0.05);
}
