// Tears in runs: a grasper that pulls, pre-strain that drives, growth that runs away, starts without a cut, accounts.
#include "src/output/run_output.hpp"
#include "src/session/session.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"
#include "tests/support/mesh_checks.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/wound/piece_audit.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fmt/format.h>
#include <random>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

/// The half of a block above a cut is pulled up; a weak plane leads the tear.
const std::string peel = R"([organ]
shape = "block"
size = [0.06, 0.016, 0.03]
edge = 0.004
[material]
young_modulus = 1e4
poisson_ratio = 0.3
toughness = 1.0
[[material.layer]]
region = "slab"
point = [0, 0, 0.0181]
normal = [0, 0, 1]
thickness = 0.001
toughness = 0.4
)" + held_below("0.001") +
                         node_spacings("0.0032", "0.008") +
                         rectangle_precut("[-0.03, 0, 0.0181]", "[0, 0, 1]", "[1, 0, 0]", "0.03", "0.04") + R"([tool]
shape = "grasper"
radius = 0.005
step = 0.5
[[tool.path]]
time = 0
position = [-0.03, 0, 0.028]
[[tool.path]]
time = 1
position = [-0.03, 0, 0.033]
[tearing]
)";

double balance(const EnergyLedger& ledger) {
  return ledger.open_share().value();
}

void require_sound(const Session& session) {
  const topology::Wound& wound = *session.wound();
  CHECK_FALSE(topology::component_difference(wound));
  double volume = 0;
  for (const topology::WoundPiece& piece : wound.pieces)
    volume += piece.volume;
  CHECK(volume == Approx(topology::volume(session.organ().domain->surface())).epsilon(1e-9));
  if (session.model().body != nullptr) {
    CHECK(session.model().field.coefficients.allFinite());
  }
}

} // namespace

TEST_CASE("A grasper that pulls tears a cut on along a weak plane, and the account of energies closes") {
  Session session(scenario_of(peel));
  const std::vector<StepResult> steps = run(session);
  REQUIRE(steps.size() == 3);
  CHECK(steps.front().tear->area == 0);
  const TearReport& last = *steps.back().tear;
  CHECK(last.area > 2e-5);
  CHECK(session.model().incision->area() == Approx(0.02 * 0.016 + last.area).epsilon(1e-3));
  CHECK_FALSE(last.severed);
  CHECK(last.ledger.tool > 0);
  CHECK(last.ledger.surface == Approx(0.4 * last.area).epsilon(0.05)); // it stays in the weak plane
  CHECK(last.ledger.dissipation >= 0);
  CHECK(balance(last.ledger) < 0.05); // measured 0.02
  CHECK(last.increments.back().release <= 1.05 * last.increments.back().toughness);
  for (const topology::FrontSegment& segment : session.model().incision->front())
    CHECK(std::abs(segment.from.z() - 0.0181) < 0.001);
  CHECK(steps.back().force.z() < 0); // the organ pulls the tool down
  require_sound(session);
}

TEST_CASE("A tear that runs fewer than two spacings below the surface is told, with place and thickness") {
  const auto told = [](const std::string& text) {
    Session session(scenario_of(text));
    REQUIRE(run(session).back().tear->area > 0);
    std::vector<std::string> warnings = session.warnings();
    std::erase_if(warnings,
                  [](const std::string& warning) { return warning.find("below the surface") == warning.npos; });
    return warnings;
  };
  CHECK(told(peel).empty()); // 3.7 spacings
  std::string shallow = replaced(peel, "toughness = 0.4", "toughness = 0.02");
  for (std::size_t at = 0; (at = shallow.find("0.0181")) != std::string::npos;)
    shallow.replace(at, 6, "0.0251");
  const std::vector<std::string> warnings = told(shallow);
  REQUIRE(warnings.size() == 1);
  // It climbs out of the plane of the cut by half a millimetre.
  CHECK_THAT(warnings.front(), Contains("the tear runs 4.4 mm below the surface, 1.4 spacings") &&
                                   Contains("nodes.fine_spacing = 0.0022"));
}

TEST_CASE("A notch in a stretched bar runs away, parts the bar, and says so") {
  Session session(scenario_of(stretched_bar(0.15, 0.05, bar_notch + "[tearing]\nstep = 1.0\n")));
  const StepResult result = session.step(session.steps().front());
  REQUIRE(result.tear);
  CHECK(result.tear->severed);
  CHECK(result.tear->unstable);
  CHECK(result.cut->pieces == 2);
  CHECK(result.tear->ledger.dissipation > 0);                         // far more is released than the surface takes
  CHECK(result.tear->ledger.loads > 2 * result.tear->ledger.surface); // the pre-strain works as the bar draws back
  CHECK(balance(result.tear->ledger) < 0.05);
  require_sound(session);
}

TEST_CASE("An account of tears that leaves more than a quarter open is told") {
  Session session(scenario_of(stretched_bar(0.15, 0.05, bar_notch + "[tearing]\nstep = 1.0\n")));
  StepResult result = session.step(session.steps().front());
  REQUIRE(result.tear->increments.size() > 1);
  const auto remarks_at = [&](double open) {
    const TemporaryFolder folder;
    RunOutput output(folder.path(), session);
    result.tear->ledger = {.tool = 0, .loads = 1.5 + 2 * open, .elastic = -0.5, .surface = 1.5, .dissipation = 0.5};
    CHECK(balance(result.tear->ledger) == Approx(open));
    output.add(session, result);
    output.write_summary(session, RunStatus::complete, "");
    return output.remarks();
  };
  CHECK(remarks_at(0.2).empty());
  REQUIRE(remarks_at(0.4).size() == 1);
  CHECK_THAT(remarks_at(0.4).front(), Contains("40 % of what they spent open"));
}

TEST_CASE("A notch in a bar that is tough enough stays as it is") {
  Session session(scenario_of(stretched_bar(0.05, 50, bar_notch + "[tearing]\n")));
  const StepResult result = session.step(session.steps().front());
  CHECK(result.tear->area == 0);
  CHECK(result.tear->increments.front().release > 0);
  CHECK(result.tear->reason == "less is released than a tear takes");
}

/// A blade through the whole height of a bar, from its side to `depth` m inside it.
std::string bar_blade(double depth, double step) {
  return fmt::format(R"([blade]
edge = [[0, 0, -0.004], [0, 0, 0.014]]
step = {}
[[blade.path]]
time = 0
position = [0.0007, -0.012, 0]
[[blade.path]]
time = 1
position = [0.0009, {}, 0]
)",
                     step, depth - 0.008);
}

TEST_CASE("A cut that a blade starts under tension runs on by itself") {
  Session session(
      scenario_of(stretched_bar(0.15, 0.2, bar_blade(0.0065, 0.25) + "[tearing]\nstep = 1.0\nmost_increments = 3\n")));
  const std::vector<StepResult> steps = run(session);
  CHECK(steps.front().tear->area == 0);
  CHECK(steps.back().tear->area > 1e-5);
  const double cut_alone = 0.0065 * 0.01;
  // Resisted, the blade has cut no more than its path when the front leaves it behind and parts the bar.
  const double section = 0.016 * 0.01;
  CHECK(steps.back().tear->area > section - cut_alone);
  CHECK(steps.back().cut->area >= steps.back().tear->area);
  CHECK(steps.back().cut->area == Approx(section).epsilon(0.05));
  CHECK(steps.back().tear->ledger.dissipation >= 0);
  require_sound(session);
}

TEST_CASE("A blade feels the toughness where the tissue tears, and less of it where that is drawn apart") {
  const auto pressed = [](double strain, const std::string& tearing) {
    Session session(scenario_of(stretched_bar(strain, 2, bar_blade(0.007, 0.2) + tearing)));
    const std::vector<StepResult> steps = run(session);
    CHECK(steps.back().cut->area > 1e-5);
    require_sound(session);
    return steps.back().cut->blade;
  };
  const BladeReport alone = pressed(0, ""), tearing = pressed(0, "[tearing]\n"), drawn = pressed(0.1, "[tearing]\n");
  CHECK(alone.edge_force > 0.3 * 2 * 0.01); // of toughness times width, N
  CHECK(tearing.edge_force == Approx(alone.edge_force).epsilon(1e-9));
  CHECK(tearing.ledger.work == Approx(alone.ledger.work).epsilon(1e-9));
  CHECK(drawn.ledger.work < 0.9 * alone.ledger.work);
  CHECK(drawn.ledger.surface < alone.ledger.surface); // the strain pays a part
  CHECK(alone.ledger.imbalance() < 0.05);
}

TEST_CASE("Two half cuts that run towards each other part a strip between them") {
  const std::string other = replaced(replaced(bar_notch, "[0.0007, -0.008, 0.005]", "[0.0007, 0.008, 0.005]"),
                                     "normal = [1, 0.03, 0.02]", "normal = [1, 0, 0]");
  Session session(scenario_of(stretched_bar(0.15, 0.05,
                                            replaced(bar_notch, "normal = [1, 0.03, 0.02]", "normal = [1, 0, 0]") +
                                                other + "[tearing]\nstep = 1.0\n")));
  const StepResult result = session.step(session.steps().front());
  INFO(result.tear->reason);
  CHECK(result.tear->severed);
  CHECK(result.cut->pieces == 2);
  CHECK(session.model().incision->sheets().size() == 2);
  CHECK(session.model().incision->front_length() < 1e-6);
  CHECK(session.model().incision->area() == Approx(0.016 * 0.01).epsilon(0.05)); // the whole section, once
  require_sound(session);
}

TEST_CASE("The load at which a tear starts does not depend on the step") {
  const auto onset = [](double step) {
    Session session(scenario_of(replaced(replaced(peel, "step = 0.5", fmt::format("step = {}", step)), "[tearing]",
                                         "[tearing]\nmost_increments = 1")));
    for (const StepSample& sample : session.steps()) {
      const StepResult result = session.step(sample);
      if (result.tear->increments.size() > 1)
        return std::pair(result.tear->increments.front(), sample.time);
    }
    return std::pair(TearIncrement{}, 0.0);
  };
  const auto [coarse, after_coarse] = onset(1);
  const auto [fine, after_fine] = onset(0.23);
  REQUIRE(coarse.time > 0);
  CHECK(after_coarse - coarse.time > 0.1);
  CHECK(coarse.time == Approx(fine.time).epsilon(1e-3));
  CHECK(coarse.force == Approx(fine.force).epsilon(1e-3));
  CHECK(coarse.release == Approx(coarse.toughness).epsilon(1e-3));
}

TEST_CASE("On the rim of a shallow cut the shape functions of no node rest on the faces of the cut alone") {
  // A cut 3 mm below the top of a dome: lip nodes in a thin wedge see their own plane and, around the front, the other
  // face of it.
  Session session(scenario_of(R"([organ]
shape = "hemisphere"
radius = 0.05
edge = 0.005
[material]
young_modulus = 6000.0
poisson_ratio = 0.45
)" + held_below("0.005") + node_spacings("0.006", "0.02") +
                              rectangle_precut("[-0.02, 0, 0.047]", "[0, 0, 1]", "[1, 0, 0]", "0.12", "0.04")));
  session.step(session.steps().front());
  const solvers::NodeCloud& nodes = session.model().sprinkling.nodes;
  solvers::ShapeFunctions shape;
  double steepest = 0; // gradient times spacing
  for (int i = 0; i < nodes.size(); ++i) {
    session.model().body->shape_at(nodes.positions[i], shape);
    for (int k = 0; k < shape.size(); ++k)
      steepest = std::max(steepest, shape.gradient(k).norm() * nodes.spacings[i]);
  }
  CHECK(steepest < 100); // it was 30000
}

TEST_CASE("The patch of a grasper stays as it is while a tear exchanges the nodes about it") {
  Session session(scenario_of(peel));
  std::vector<Vector3> patch;
  for (const StepSample& sample : session.steps()) {
    session.step(sample);
    std::vector<Vector3> now = session.model().patch.rest;
    std::sort(now.begin(), now.end(), [](const Vector3& a, const Vector3& b) {
      return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
    });
    if (!patch.empty()) {
      REQUIRE(now.size() == patch.size());
      for (std::size_t k = 0; k < now.size(); ++k)
        CHECK((now[k] - patch[k]).norm() < 1e-12);
    }
    patch = now;
  }
}

TEST_CASE("A tear starts without a cut where the averaged stress reaches the strength, across it") {
  // E strain = 1500 Pa along x in the middle of the bar.
  Session weak(
      scenario_of(stretched_bar(0.15, 0.02, "[tearing]\nstrength = 1000\nlength = 0.003\nmost_increments = 1\n")));
  const StepResult result = weak.step(weak.steps().front());
  CHECK(result.tear->seeded);
  REQUIRE(weak.model().incision != nullptr);
  CHECK(std::abs(topology::triangle_normal(weak.model().incision->sheets().front(), 0).x()) > 0.9);
  require_sound(weak);
  Session strong(scenario_of(stretched_bar(0.15, 0.02, "[tearing]\nstrength = 4000\nlength = 0.003\n")));
  CHECK_FALSE(strong.step(strong.steps().front()).tear->seeded);
  CHECK(strong.model().incision == nullptr);
}

TEST_CASE("Scenarios that cannot tear or grasp are refused with the reason") {
  CHECK_THROWS_WITH(scenario_of(replaced(peel, "toughness = 1.0", "toughness = -1")),
                    Contains("material.toughness = -1") && Contains("<= value"));
  CHECK_THROWS_WITH(scenario_of(replaced(peel, "toughness = 0.4", "toughness = 0")),
                    Contains("material.layer[1].toughness = 0") || Contains("toughness = 0"));
  CHECK_THROWS_WITH(scenario_of(replaced(peel, "toughness = 1.0\n", "")),
                    Contains("material.layer without material.toughness") &&
                        Contains("tearing without material.toughness"));
  CHECK_THROWS_WITH(
      scenario_of("fixed = []\n" + replaced(peel,
                                            "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 0.001]\nnormal "
                                            "= [0, 0, 1]\n",
                                            "")),
      Contains("nothing is fixed"));
  CHECK_THROWS_WITH(Session(scenario_of(replaced(peel, "[-0.03, 0, 0.028]", "[-0.03, 0, 0.046]"))),
                    Contains("the grasper cannot reach the organ") && Contains("0.016 m from the surface"));
  CHECK_THROWS_WITH(scenario_of(replaced(peel, "step = 0.5", "step = 0.5\nrelease = 0\ngrasp = 0.1")),
                    Contains("tool.release = 0 s: not after it takes hold"));
  CHECK_THROWS_WITH(scenario_of(stretched_bar(0.1, 1, "[tearing]\n")), Contains("without tearing.strength no tear"));
}

TEST_CASE("A grasper that lets go leaves the organ as it was, and its work is booked as lost") {
  const std::string text =
      replaced(replaced(peel, "toughness = 0.4", "toughness = 40"), "step = 0.5", "step = 0.25\nrelease = 0.7");
  Session session(scenario_of(replaced(text, "toughness = 1.0", "toughness = 100.0")));
  const std::vector<StepResult> steps = run(session);
  REQUIRE(steps.size() == 5);
  CHECK(steps[2].force.norm() > 1e-3);
  CHECK(steps[3].force.norm() == 0); // t = 0.75 s
  CHECK(steps[3].cut->opening < 1e-9);
  const EnergyLedger& ledger = steps.back().tear->ledger;
  CHECK(ledger.dissipation == Approx(ledger.tool).epsilon(1e-6));
  CHECK(std::abs(ledger.elastic) < 1e-6 * ledger.tool);
}

TEST_CASE("A hand closes and opens the grasper whatever the scenario's times") {
  Session session(scenario_of(
      replaced(replaced(peel, "toughness = 1.0", "toughness = 100.0"), "toughness = 0.4", "toughness = 100.0")));
  const std::vector<StepSample>& steps = session.steps();
  session.set_options({.grip = false});
  CHECK(session.step(steps[0]).force.norm() == 0);
  CHECK_FALSE(session.grasps());
  session.set_options({.grip = true});
  StepSample away = steps[1];
  away.tool->point.z() = 0.04;
  CHECK(session.step(away).force.norm() == 0);
  CHECK_FALSE(session.grasps());
  StepSample back = steps[0];
  back.time = 0.6;
  session.step(back);
  CHECK(session.grasps());
  CHECK(session.step(steps[2]).force.norm() > 1e-3);
}

TEST_CASE("In the real-time loop a tear goes on solve by solve and the force stays continuous") {
  const TearingLoop loop =
      tear_in_loop(scenario_of(replaced(replaced(peel, "0.033]", "0.036]"), "step = 0.5", "step = 0.05")), 900);
  CHECK(loop.tearing >= 2);
  CHECK(loop.peak > 0.02);
  CHECK(loop.jump < 0.02 * loop.peak); // a hand-over takes 20 ticks
}

TEST_CASE("Tears under random loads: no crash, nothing that is not finite, surfaces stay closed") {
  std::mt19937 random(7);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  for (int k = 0; k < 5; ++k) {
    const std::string cut =
        fmt::format("[[precut]]\nshape = \"disc\"\ncentre = [{}, {}, {}]\nnormal = [{}, {}, {}]\nradius = {}\npressure "
                    "= {}\n",
                    between(-0.008, 0.008), between(-0.008, 0.008), between(0.001, 0.009), between(-1, 1),
                    between(-1, 1), between(-1, 1), between(0.003, 0.006), between(0, 200));
    const std::string text =
        stretched_bar(between(-0.1, 0.2), std::pow(10, between(-2, 0.5)),
                      cut + "[cut]\nunheld = \"hold\"\n[gravity]\nacceleration = [0, 0, -9.81]\n[tearing]\n"
                            "step = 1.0\nmost_increments = 3\n");
    INFO(text);
    std::optional<Session> session;
    try {
      session.emplace(scenario_of(text));
    } catch (const InputError&) { // a disc that cuts off less than a node
      continue;
    }
    const StepResult result = session->step(session->steps().front());
    CHECK(result.tear->ledger.dissipation >= 0);
    CHECK(std::isfinite(result.tear->ledger.imbalance()));
    require_sound(*session);
  }
}
