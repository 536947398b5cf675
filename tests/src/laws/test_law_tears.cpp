// Bodies whose law is not linear that tear: a strip in pure shear against its closed form, a peel at small strain
// against the linear one, a flap that is folded back.
#include "experiments/pure_shear_crack/strip_scenario.hpp"
#include "src/model/finite_model.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"
#include "topology/wound/piece_audit.hpp"

#include <catch2/catch.hpp>
#include <fmt/format.h>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

constexpr double shear = 2000, nu = 0.45, stretch = 1.3, height = 0.05; // Pa, m; of the strip

double strip_release() {
  return experiments::strip_release({solvers::NeoHookeanLaw{shear}, solvers::bulk_modulus_of(shear, nu), {}}, stretch,
                                    height);
}

/// A neo-Hookean strip; `toughness`: over W H.
std::string stretched_strip(double toughness, const std::string& more = "") {
  const experiments::StripScenario strip{.law = "neo_hookean",
                                         .constants = fmt::format("young_modulus = {}", 2 * (1 + nu) * shear),
                                         .poisson_ratio = nu,
                                         .stretch = stretch,
                                         .toughness = toughness * strip_release(),
                                         .height = height,
                                         .tearing = "most_increments = 4\n"};
  return strip.text() + more;
}

/// The half of a block above a cut is drawn up by so many metres; `law`: a line of the material, may be empty.
std::string peel(const std::string& law, double toughness, double way, const std::string& more = "") {
  return fmt::format(R"([organ]
shape = "block"
size = [0.06, 0.016, 0.03]
edge = 0.004
[material]
{}young_modulus = 1e4
poisson_ratio = 0.3
toughness = {}
)",
                     law, toughness) +
         held_below("0.001") + node_spacings("0.0032", "0.008") +
         rectangle_precut("[-0.03, 0, 0.0181]", "[0, 0, 1]", "[1, 0, 0]", "0.03", "0.04") +
         fmt::format(R"([tool]
shape = "grasper"
radius = 0.005
step = 0.25
[[tool.path]]
time = 0
position = [-0.03, 0, 0.028]
[[tool.path]]
time = 1
position = [-0.03, 0, {}]
[tearing]
)",
                     0.028 + way) +
         more;
}

const std::string neo_hookean = "law = \"neo_hookean\"\n";

} // namespace

TEST_CASE("A strip of a law in pure shear tears where W H reaches the toughness, and straight on") {
  const double wanted = strip_release();
  Session tough(scenario_of(stretched_strip(1.05)));
  const StepResult rests = tough.step(tough.steps().front());
  INFO("W H = " << wanted << " J/m2, G = " << rests.tear->increments.front().release);
  CHECK(rests.tear->area == 0);
  CHECK(rests.tear->increments.front().release == Approx(wanted).epsilon(0.04));
  Session weak(scenario_of(stretched_strip(0.95)));
  const StepResult runs = weak.step(weak.steps().front());
  CHECK(runs.tear->increments.size() == 5);
  CHECK(runs.tear->unstable); // as it goes on, the strip ahead stays as it is
  for (const TearIncrement& increment : runs.tear->increments) {
    INFO(increment.number << ": " << increment.front.transpose() << ", G = " << increment.release);
    CHECK(std::abs(increment.front.y()) < 0.02 * height);
    CHECK(increment.release == Approx(wanted).epsilon(0.05));
  }
  const EnergyLedger& ledger = runs.tear->ledger;
  // What the body gives up; 0.2 % of the strip's energy, by which node sets differ, is 6 % of that.
  CHECK(-ledger.elastic == Approx(wanted * runs.tear->area).epsilon(0.08));
  CHECK(ledger.open_share().value() < 0.08);
  CHECK_FALSE(topology::component_difference(*weak.wound()));
}

TEST_CASE("At small strain a peel of a law tears at the load of the linear one, as far") {
  constexpr double toughness = 0.004, way = 0.0005; // G goes with the square of the way
  const auto torn = [&](const std::string& law) {
    Session session(scenario_of(peel(law, toughness, way, "[cut]\nsight = \"enriched\"\n")));
    return run(session);
  };
  const std::vector<StepResult> linear = torn(""), finite = torn(neo_hookean);
  const auto onset = [](const std::vector<StepResult>& steps) {
    for (const StepResult& step : steps)
      if (step.tear->increments.size() > 1)
        return step.tear->increments.front();
    return TearIncrement{};
  };
  INFO("linear " << onset(linear).force << " N at " << onset(linear).time << " s, " << linear.back().tear->area
                 << " m2; law " << onset(finite).force << " N at " << onset(finite).time << " s, "
                 << finite.back().tear->area << " m2; open " << linear.back().tear->ledger.open_share().value_or(0)
                 << " and " << finite.back().tear->ledger.open_share().value_or(0));
  REQUIRE(onset(linear).force > 0);
  CHECK(onset(finite).force == Approx(onset(linear).force).epsilon(0.05));
  CHECK(onset(finite).time == Approx(onset(linear).time).epsilon(0.05));
  CHECK(linear.back().tear->area > 3e-5);
  CHECK(finite.back().tear->area == Approx(linear.back().tear->area).epsilon(0.15));
}

TEST_CASE("A thick flap of a law that is drawn up by half of its thickness tears, and the account of energies closes") {
  Session session(scenario_of(peel(neo_hookean, 0.4, 0.0065)));
  const std::vector<StepResult> steps = run(session);
  const TearReport& tear = *steps.back().tear;
  INFO(tear.reason << ", " << tear.area << " m2, open " << tear.ledger.imbalance());
  CHECK(tear.area > 3e-5);
  CHECK(steps.back().rotation_degrees > 15);
  CHECK(tear.ledger.open_share().value() < 0.1);
  CHECK(tear.ledger.tool > 0);
  CHECK(steps.back().force.norm() > 0);
  CHECK_FALSE(topology::component_difference(*session.wound()));
}

TEST_CASE("The load at which a law tears does not depend on the step") {
  const auto onset = [](const std::string& step) {
    Session session(scenario_of(replaced(peel(neo_hookean, 0.4, 0.008), "step = 0.25", step)));
    for (const StepResult& result : run(session))
      if (result.tear->increments.size() > 1)
        return result.tear->increments.front();
    return TearIncrement{};
  };
  const TearIncrement coarse = onset("step = 0.5"), fine = onset("step = 0.1");
  INFO("coarse " << coarse.force << " N at " << coarse.time << " s, fine " << fine.force << " N at " << fine.time);
  REQUIRE(coarse.force > 0);
  CHECK(coarse.force == Approx(fine.force).epsilon(0.02));
  CHECK(coarse.time == Approx(fine.time).epsilon(0.02));
}

TEST_CASE("In the real-time loop a strip of a law tears solve by solve") {
  const TearingLoop loop = tear_in_loop(scenario_of(stretched_strip(0.9, R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.1
[[tool.path]]
time = 0
position = [0.06, 0.0, 0.031]
[[tool.path]]
time = 1
position = [0.06, 0.0, 0.026]
[output]
figures = false
)")),
                                        600);
  CHECK(loop.tearing >= 3);
}

TEST_CASE("A grasper in a hand draws a body of a law as one on a path does, and lets it go") {
  const std::string text = peel(neo_hookean, 1000, 0.006);
  Session path(scenario_of(text));
  const std::vector<StepResult> wanted = run(path);
  Session hand(
      scenario_of(text), [](const std::string&) {}, Leader::device);
  SessionOptions options{.force_only = true, .going_on = true, .tear_gradually = true};
  options.grip = false;
  hand.set_options(options);
  hand.prepare(path.steps().front());
  CHECK(hand.step(path.steps().front()).force.norm() == 0);
  CHECK_FALSE(hand.grasps());
  options.grip = true;
  hand.set_options(options);
  for (std::size_t k = 0; k < path.steps().size(); ++k) {
    const Vector3 force = hand.step(path.steps()[k]).force;
    CHECK(hand.grasps());
    INFO(force.transpose() << " N, on the path " << wanted[k].force.transpose() << " N");
    CHECK((force - wanted[k].force).norm() <= 0.01 * wanted.back().force.norm());
  }
  CHECK(wanted.back().force.norm() > 0.01);
  options.grip = false;
  hand.set_options(options);
  CHECK(hand.step(path.steps().back()).force.norm() < 1e-3 * wanted.back().force.norm());
  CHECK_FALSE(hand.grasps());
  CHECK(hand.model().nodal_displacements().cwiseAbs().maxCoeff() < 1e-5);
}

TEST_CASE("In the real-time loop a grasper tears a body of a law and its force stays continuous") {
  const TearingLoop loop =
      tear_in_loop(scenario_of(replaced(peel(neo_hookean, 0.4, 0.008), "step = 0.25", "step = 0.05")), 900);
  CHECK(loop.tearing >= 1);
  CHECK(loop.peak > 0.01);
  CHECK(loop.jump < 0.02 * loop.peak); // a hand-over takes 20 ticks
}

TEST_CASE("Tears that a law does not go with are refused in words") {
  const auto refused = [](const std::string& text, const std::string& what) {
    Session session(scenario_of(text));
    CHECK_THROWS_WITH(session.step(session.steps().front()),
                      Contains(what + " does not go with material.law = \"neo_hookean\""));
  };
  refused(replaced(peel(neo_hookean, 0.4, 0.01), "toughness = 0.4\n",
                   "toughness = 0.4\n[[material.prony]]\nshare = 0.3\ntime = 2\n"),
          "[tearing] with material.prony");
  refused(peel(neo_hookean, 0.4, 0.01, "strength = 1000\n"), "tearing.strength");
}
