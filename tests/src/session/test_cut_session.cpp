// Cuts in sessions: precuts, blades that nothing resists, pieces, refusals, bodies that follow.
#include "src/session/session.hpp"
#include "src/tissue/cut_checks.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/virtual_session.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/files/surface_io.hpp"
#include "topology/organ/organs.hpp"
#include "topology/search/point_tree.hpp"
#include "topology/wound/piece_audit.hpp"
#include "topology/wound/splinters.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

// Down through the block beside its middle, askew to everything.
const std::string slice = blade({"[0.004, 0, 0.036]", "[0.002, 0, -0.006]"}, 0.04, "0.2");
// Across the block above its base: what is above is held by nothing.
const std::string topping = blade({"[-0.036, 0, 0.0151]", "[0.036, 0, 0.0153]"}, 0.04, "0.25");

double total(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

constexpr double block_volume = 0.06 * 0.06 * 0.03;

} // namespace

TEST_CASE("A cut that is put off is the same cut in fewer increments") {
  // In from above on a way that turns, out again, and in beside it.
  const std::string way = blade({"[-0.004, 0, 0.034]", "[-0.004, 0, 0.022]", "[0.002, 0.001, 0.020]",
                                 "[0.003, 0, 0.036]", "[0.012, 0, 0.036]", "[0.012, 0, 0.021]"},
                                0.009, "0.1");
  Session plain = session_of(cut_block + way);
  Session waiting = session_of(cut_block + replaced(way, "step = 0.1", "step = 0.1\nadvance = 0.8"));
  const auto increments = [](const std::vector<StepResult>& results) {
    return std::count_if(results.begin(), results.end(), [](const StepResult& r) { return r.cut->triangles > 0; });
  };
  const std::vector<StepResult> every = run(plain), some = run(waiting);
  REQUIRE(every.size() == some.size());
  CHECK(increments(some) >= 4);
  CHECK(2 * increments(some) <= increments(every));
  // The body is at rest, so that poses are the same whenever they are carried there.
  CHECK(waiting.model().incision->area() == Approx(plain.model().incision->area()).epsilon(1e-3));
  CHECK(waiting.model().incision->front_length() == Approx(plain.model().incision->front_length()).epsilon(1e-3));
  CHECK(waiting.model().incision->sheets().size() == plain.model().incision->sheets().size());
  for (std::size_t i = 0; i < every.size(); ++i)
    CHECK(some[i].cut->area <= every[i].cut->area * (1 + 1e-3));
}

TEST_CASE("A pressurised disc opens, by about as much as in an infinite body, and keeps the volume of the block") {
  const std::string sight = GENERATE(as<std::string>(), "enriched", "appended");
  Session session = session_of(replaced(cut_block, "fine_spacing = 0.005", "fine_spacing = 0.0035") + disc_precut +
                               "pressure = 100\n[cut]\nsight = \"" + sight + "\"\n");
  REQUIRE(session.steps().size() == 1);
  const StepResult result = session.step(session.steps().front());
  REQUIRE(result.cut);
  CHECK(result.cut->pieces == 1);
  CHECK(total(result.cut->volumes) == Approx(block_volume).epsilon(1e-9));
  CHECK(result.cut->area == Approx(3.14159265 * 1e-4).epsilon(0.03)); // a polygon on the circle
  // Sneddon: volume 16 (1 - nu^2) p a^3 / (3 E), opening 8 (1 - nu^2) p a / (pi E). The block is three discs wide and
  // its free faces are near: it opens more.
  const double volume = 16 * 0.91 * 100 * 1e-6 / (3 * 1e4);
  CHECK(result.cut->opening_volume > 0.9 * volume);
  CHECK(result.cut->opening_volume < 1.5 * volume);
  CHECK(result.cut->opening > 0.8 * 8 * 0.91 * 100 * 0.01 / (3.14159265 * 1e4));
  CHECK(result.cut->closed_pairs == 0);
  CHECK(result.residual < 1e-9);
}

TEST_CASE("A disc that is drawn together closes and does not go through itself") {
  const std::string text = cut_block + disc_precut + "pressure = -100\n";
  for (const std::string lips : {"frictionless", "sticking"}) {
    Session session = session_of(text + "[cut]\nlips = \"" + lips + "\"\n");
    const StepResult result = session.step(session.steps().front());
    CHECK(result.cut->closed_pairs == result.cut->lip_pairs);
    CHECK(result.cut->opening < 1e-9);
    CHECK(std::abs(result.cut->opening_volume) < 1e-9);
    CHECK(result.cut->lips_converged);
    CHECK(result.residual < 1e-8);
  }
  Session open = session_of(text + "[cut]\nlips = \"open\"\n");
  CHECK(open.step(open.steps().front()).cut->opening_volume < -1e-8);
}

TEST_CASE("A blade that comes down through a stretched block leaves two pieces that draw apart") {
  Session session = session_of(stretched(cut_block) + slice);
  const std::vector<StepResult> results = run(session);
  double area = 0;
  for (const StepResult& result : results) {
    REQUIRE(result.cut);
    CHECK_FALSE(result.cut->refused);
    CHECK(result.cut->area >= area);
    area = result.cut->area;
    CHECK(total(result.cut->volumes) == Approx(block_volume).epsilon(1e-9));
    CHECK(result.residual < 1e-8);
  }
  CHECK(results.front().cut->pieces == 1);
  const CutReport& last = *results.back().cut;
  CHECK(last.pieces == 2);
  CHECK(last.unheld == 0);
  CHECK(last.front_length == 0);
  CHECK(last.area == Approx(0.06 * 0.03).epsilon(0.01)); // tilted by 3 degrees
  CHECK(last.opening > 1e-4);
  CHECK(last.opening_volume > 0);
  CHECK(results[3].cut->kept_nodes > results[3].cut->nodes / 2);
  // The block narrows towards the cut on both sides.
  CHECK(session.model().at({0.008, 0, 0.029}).displacement.x() > 0);
  CHECK(session.model().at({-0.002, 0, 0.029}).displacement.x() < 0);
}

TEST_CASE("A wound stays as it is while the blade goes back through it, and goes on as if it had not") {
  // A slanted edge, drawn along a stretched block whose faces part behind it.
  const auto drawn = [](const std::vector<std::pair<double, double>>& way) {
    std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.4\npretension = [0.15, 0, 0]") +
                       "[blade]\nedge = [[0, 0, 0], [0, 0.02, 0.03]]\nstep = 0.05\n";
    for (const auto& [time, y] : way)
      text += fmt::format("[[blade.path]]\ntime = {}\nposition = [0.001, {}, 0.012]\n", time, y);
    return text;
  };
  Session straight = session_of(drawn({{0, -0.045}, {0.5, -0.012}, {0.8, 0.005}}));
  Session back = session_of(drawn({{0, -0.045}, {0.5, -0.012}, {0.9, -0.045}, {1.3, -0.012}, {1.6, 0.005}}));
  StepResult there, again, last;
  for (const StepSample& sample : back.steps()) {
    last = back.step(sample);
    CHECK_FALSE(last.cut->refused);
    if (sample.time <= 0.5)
      there = last;
    else if (sample.time <= 1.3)
      again = last;
  }
  CHECK(there.cut->opening_volume > 5e-8);
  CHECK(again.cut->area < 1.01 * there.cut->area);
  CHECK(again.cut->opening_volume == Approx(there.cut->opening_volume).epsilon(0.03));
  const CutReport expected = *run(straight).back().cut;
  CHECK(last.cut->area == Approx(expected.area).epsilon(0.01));
  CHECK(last.cut->front_length == Approx(expected.front_length).epsilon(0.03));
  CHECK(last.cut->opening_volume == Approx(expected.opening_volume).epsilon(0.06));
}

TEST_CASE("Where a hand leads the blade off the way that was foreseen nodes at the front are fine all the same") {
  const bool appends = GENERATE(true, false);
  Session session = session_of(cut_block + (appends ? by_appending : by_rebuilding) +
                               "[blade]\nedge = [[0, -0.009, 0], [0, 0.009, 0.001]]\nstep = 0.05\n"
                               "[[blade.path]]\ntime = 0\nposition = [-0.02, 0, 0.034]\n"
                               "[[blade.path]]\ntime = 1\nposition = [-0.02, 0, 0.02]\n");
  session.lift_blade();
  StepSample sample = session.steps().front();
  int updated = 0, renewed = 0;
  for (int k = 0; k < 16; ++k) {
    sample.time += 0.01;
    sample.blade->time = sample.time;
    sample.blade->position = {0.018 + 0.0002 * k, 0.001, 0.034 - 0.0012 * k};
    const StepResult result = session.step(sample);
    CHECK_FALSE(result.cut->refused);
    if (result.cut->triangles == 0)
      continue;
    updated += result.cut->update == SystemUpdate::updated ? 1 : 0;
    renewed += result.cut->update_reason == "the front has left the fine nodes" ? 1 : 0;
    const solvers::NodeCloud& nodes = session.model().sprinkling.nodes;
    const topology::PointTree tree(nodes.positions);
    for (const topology::FrontSegment& segment : session.model().incision->front())
      CHECK(nodes.spacings[tree.nearest(segment.to).index] < 1.6 * session.zone().spacing.fine);
  }
  CHECK((updated >= 4) == appends);
  CHECK((renewed >= 1) == appends);
}

TEST_CASE("A box cut out of a block: lip nodes keep off the folds of its sheet, and it opens under pressure") {
  const TemporaryFolder folder;
  topology::SurfaceMesh box{{},
                            {{0, 2, 1},
                             {1, 2, 3},
                             {4, 5, 6},
                             {5, 7, 6},
                             {0, 1, 4},
                             {1, 5, 4},
                             {2, 6, 3},
                             {3, 6, 7},
                             {0, 4, 2},
                             {2, 4, 6},
                             {1, 3, 5},
                             {3, 7, 5}}};
  for (int k = 0; k < 8; ++k)
    box.vertices.emplace_back((k & 1) != 0 ? 0.0127 : -0.0113, (k & 2) != 0 ? 0.0123 : -0.0117,
                              (k & 4) != 0 ? 0.026 : 0.008);
  topology::write_surface(folder.path() / "box.obj", box);
  const std::string coarse = GENERATE(as<std::string>(), "0.012", "0.009", "0.007");
  const std::string sight = GENERATE(as<std::string>(), "enriched", "appended");
  const auto file = write_file(folder.path() / "case.toml",
                               replaced(cut_block, "coarse_spacing = 0.012", "coarse_spacing = " + coarse) +
                                   "[cut]\nunheld = \"hold\"\nsight = \"" + sight +
                                   "\"\n[[precut]]\nshape = \"file\"\nfile = \"box.obj\"\npressure = 50\n");
  Session session(read_scenario(file));
  const StepResult last = run(session).back();
  CHECK(last.cut->pieces == 2);
  CHECK(last.cut->volumes.back() == Approx(0.024 * 0.024 * 0.018).epsilon(1e-9));
  CHECK(last.cut->opening_volume > 1e-8);
  CHECK(last.residual < 1e-8);
  const solvers::NodeCloud& nodes = session.model().sprinkling.nodes;
  int lips = 0;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] == solvers::NodeKind::lip) {
      ++lips;
      const double offset = solvers::lip_offset * nodes.spacings[i];
      CHECK(session.model().incision->closest(nodes.positions[i], 2 * offset)->distance >= 0.5 * offset);
    }
  CHECK(lips >= 24);
}

TEST_CASE("A severed piece that nothing holds is held, dropped or refused as the scenario asks, and said") {
  SECTION("hold") {
    Session session = session_of(cut_block + topping + "[cut]\nunheld = \"hold\"\n");
    const std::vector<StepResult> results = run(session);
    CHECK(results.back().cut->pieces == 2);
    CHECK(results.back().cut->unheld == 1);
    REQUIRE(session.warnings().size() == 1);
    CHECK_THAT(session.warnings().front(), Contains("1 of 2 pieces") && Contains("held by no fixed region"));
  }
  SECTION("drop") {
    Session session = session_of(cut_block + topping + "[cut]\nunheld = \"drop\"\n");
    CHECK(run(session).back().cut->pieces == 2);
    CHECK_THAT(session.warnings().front(), Contains("leaves the computation"));
    CHECK(session.model().at({0, 0, 0.025}).displacement.norm() == 0);
  }
  SECTION("refuse") {
    Session session = session_of(cut_block + topping + "[cut]\nunheld = \"refuse\"\n");
    const std::vector<StepResult> results = run(session);
    CHECK(results.back().cut->pieces == 1);
    CHECK(std::any_of(results.begin(), results.end(), [](const StepResult& r) { return r.cut->refused; }));
    CHECK_THAT(session.warnings().front(), Contains("refused") && Contains("held by no fixed region"));
  }
}

TEST_CASE("A tool meets nothing of a piece that has left the computation, and presses what is there") {
  const std::string method = GENERATE("galerkin", "collocation");
  const std::string condition = GENERATE("frictionless", "bonded");
  const std::string rest =
      "[cut]\nunheld = \"drop\"\n[method]\nname = \"" + method + "\"\n[contact]\ncondition = \"" + condition + "\"\n";
  Session gone = session_of(cut_block + ball_tool +
                            rectangle_precut("[0, 0, 0.0203]", "[0, 0, 1]", "[1, 0, 0]", "0.1", "0.1") + rest);
  for (const StepResult& result : run(gone))
    CHECK(result.force.isZero(0));
  // A corner away from the tool.
  Session there =
      session_of(cut_block + ball_tool +
                 rectangle_precut("[0.024, 0.001, 0.0203]", "[1, 0.02, 0.03]", "[0, 0, 1]", "0.1", "0.1") + rest);
  CHECK(run(there).back().force.z() > 0);
}

TEST_CASE("A cut that would leave a piece smaller than the node spacing is refused and changes nothing") {
  Session session =
      session_of(stretched(cut_block) + blade({"[0.0288, 0, 0.036]", "[0.0288, 0, -0.006]"}, 0.04, "0.5"));
  const StepResult before = session.step(session.steps()[0]);
  StepResult last = session.step(session.steps()[1]);
  const CutReport partial = *last.cut;
  const auto nodes = session.model().sprinkling.nodes.positions;
  const VectorX coefficients = session.model().field.coefficients;
  last = session.step(session.steps()[2]);
  REQUIRE(last.cut->refused);
  CHECK_THAT(last.cut->reason, Contains("smaller than the node spacing"));
  CHECK(last.cut->surface_hash == partial.surface_hash);
  CHECK(last.cut->area == partial.area);
  CHECK(last.cut->pieces == 1);
  CHECK(session.model().sprinkling.nodes.positions == nodes);
  CHECK(session.model().field.coefficients == coefficients);
  static_cast<void>(before);
}

TEST_CASE("What rounding leaves between faces that all but coincide is no piece of tissue") {
  // A cushion about a square, closed, of this thickness: across the block, or within it.
  const auto cushion = [](double width, double thickness) {
    topology::SurfaceMesh sheet;
    const double half = 0.5 * width;
    sheet.vertices = {{0.002, -half, 0.015 - half}, {0.002, half, 0.015 - half},   {0.002, half, 0.015 + half},
                      {0.002, -half, 0.015 + half}, {0.002 - thickness, 0, 0.015}, {0.002 + thickness, 0, 0.015}};
    for (int i = 0; i < 4; ++i) {
      sheet.triangles.push_back({i, (i + 1) % 4, 5});
      sheet.triangles.push_back({(i + 1) % 4, i, 4});
    }
    return sheet;
  };
  const topology::SurfaceMesh organ = topology::make_block({0.06, 0.06, 0.03}, 0.006);
  const std::vector<FixedRegion> base = scenario_of(cut_block + disc_precut).fixed;
  const solvers::SpacingField spacing{.fine = 0.005, .coarse = 0.005};
  constexpr double thinnest = 6e-4; // a quarter of the edges of such a spacing's sheets
  for (const auto& [thickness, is_splinter] : {std::pair(1e-9, true), {1e-6, true}, {1e-3, false}}) {
    const topology::Wound wound = topology::cut_surface(organ, {cushion(0.016, thickness)});
    REQUIRE(wound.pieces.size() == 2);
    const int small = wound.pieces[0].volume < wound.pieces[1].volume ? 0 : 1;
    CHECK(wound.pieces[small].volume > 0);
    CHECK_THROWS_WITH(require_pieces(wound, spacing), Contains("smaller than the node spacing"));
    const auto left = topology::without_splinters(wound, thinnest);
    REQUIRE(left.has_value() == is_splinter);
    if (!left) {
      CHECK(unheld_pieces(wound, base).size() == 1);
      continue;
    }
    REQUIRE(left->pieces.size() == 1);
    CHECK(left->pieces[0].volume == wound.pieces[static_cast<std::size_t>(1 - small)].volume);
    CHECK(topology::volume(left->surface) == Approx(left->pieces[0].volume));
    CHECK_FALSE(topology::manifold_defect(left->surface).has_value());
    CHECK_FALSE(topology::component_difference(*left).has_value());
    CHECK(unheld_pieces(*left, base).empty());
    CHECK_NOTHROW(require_pieces(*left, spacing));
  }
  const TemporaryFolder folder;
  topology::write_surface(folder.path() / "cut.obj", cushion(0.12, 1e-8));
  const auto scenario = write_file(folder.path() / "case.toml",
                                   stretched(cut_block) + "[[precut]]\nshape = \"file\"\nfile = \"cut.obj\"\n");
  Session session(read_scenario(scenario));
  const StepResult result = session.step(session.steps().front());
  CHECK(session.wound()->pieces.size() == 2);
  CHECK(result.cut->pieces == 2);
  CHECK(result.cut->unheld == 0);
  CHECK(result.cut->volumes.size() == 2);
  CHECK(total(result.cut->volumes) == Approx(block_volume).epsilon(1e-5));
  CHECK(result.cut->opening > 1e-4);
  CHECK(result.cut->opening < 0.01);
  CHECK(result.residual < 1e-8);
}

TEST_CASE("A cut where the tool is pressing is refused with the way out, a node spacing away it is made") {
  const std::string tool = R"([tool]
shape = "sphere_tip"
radius = 0.01
[[tool.path]]
time = 0
position = [0, 0, 0.031]
[[tool.path]]
time = 1
position = [0, 0, 0.028]
)";
  // Through the contact, one second after the tool has come to rest.
  const auto at = [&](const std::string& x) {
    return replaced(
        replaced(blade({"[" + x + ", 0, 0.034]", "[" + x + ", 0, 0.02]"}, 0.04, "0.5"), "time = 1", "time = 3"),
        "time = 0", "time = 2");
  };
  Session under = session_of(cut_block + replaced(tool, "radius = 0.01", "radius = 0.01\nstep = 0.25") + at("0.0005"));
  const std::vector<StepResult> refused = run(under);
  CHECK(refused.back().cut->refused);
  CHECK_THAT(under.warnings().back(), Contains("where the tool is pressing") && Contains("lift the tool"));
  CHECK(refused.back().cut->area == 0);
  CHECK(refused.back().force.z() > 0);
  Session beside = session_of(cut_block + replaced(tool, "radius = 0.01", "radius = 0.01\nstep = 0.25") + at("0.02"));
  const std::vector<StepResult> cut = run(beside);
  CHECK_FALSE(cut.back().cut->refused);
  CHECK(cut.back().cut->area > 0);
  CHECK(cut.back().force.z() == Approx(refused.back().force.z()).epsilon(0.05)); // a shallow cut two radii away
}

TEST_CASE("A blade cuts through the place where a tool has pressed, once that is lifted") {
  const std::string presses = R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[[tool.path]]
time = 0
position = [0, 0, 0.031]
[[tool.path]]
time = 0.5
position = [0, 0, 0.028]
[[tool.path]]
time = 1
position = [0, 0, 0.05]
)";
  const std::string cuts = replaced(
      replaced(blade({"[0, 0, 0.034]", "[0, 0, 0.02]"}, 0.02, "0.25"), "time = 1", "time = 3"), "time = 0", "time = 2");
  Session session = session_of(cut_block + presses + cuts);
  const std::vector<StepResult> results = run(session);
  for (const StepResult& result : results)
    CHECK_FALSE(result.cut->refused);
  CHECK(results.back().cut->area == Approx(0.04 * 0.01).epsilon(0.02));
  CHECK(std::any_of(results.begin(), results.end(), [](const StepResult& result) { return result.force.z() > 0; }));
}

TEST_CASE("A blade that misses the organ, or starts inside it, is told") {
  const auto told = [](const std::string& positions_from, const std::string& positions_to) {
    const Session session = session_of(cut_block + blade({positions_from, positions_to}, 0.01, "0.5"));
    std::string all;
    for (const std::string& warning : session.warnings())
      all += warning + "\n";
    return all;
  };
  CHECK(told("[0, 0, 0.035]", "[0, 0, 0.02]").empty());
  CHECK(told("[0.2, 0, 0.016]", "[-0.2, 0.001, 0.015]").empty()); // in one step through the whole organ
  CHECK_THAT(told("[-0.05, 0, 0.034]", "[0.05, 0, 0.034]"),
             Contains("case.toml:15: the blade never meets the organ") && Contains("no nearer than 4 mm"));
  CHECK_THAT(told("[0, 0, 0.027]", "[0, 0, 0.02]"),
             Contains("case.toml:15: the blade starts inside the organ, 3 mm deep at ") && Contains("left uncut"));
}

TEST_CASE("A blade starts from the tissue as it is deformed: the cut at rest is where the material was") {
  // Stretched along x and free at its sides, the block has drawn in; a cut at a place in space meets material that was
  // farther out at rest.
  const std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\npretension = [0.1, 0, 0]");
  Session session = session_of(text + blade({"[0.02, 0, 0.036]", "[0.02, 0, 0.02]"}, 0.04, "0.5"));
  run(session);
  REQUIRE(session.model().incision != nullptr);
  const auto on = session.model().incision->closest({0.022, 0, 0.027}, 0.01);
  REQUIRE(on);
  CHECK(on->point.x() > 0.0203);
  CHECK(on->point.x() < 0.024);
}

TEST_CASE("Precuts that cannot be made are refused with file and line") {
  CHECK_THROWS_WITH(session_of(cut_block + disc_precut + disc_precut),
                    Contains("case.toml:20") && Contains("precut[2]: 100 % of its area lie on"));
  CHECK_THROWS_WITH(session_of(cut_block + disc_precut + replaced(disc_precut, "[0, 0, 0.016]", "[0.008, 0, 0.016]")),
                    Contains("precut[2]") && Contains("of its area lie on the precuts before it"));
  CHECK_NOTHROW(session_of(cut_block + disc_precut + replaced(disc_precut, "[0, 0, 1]", "[1, 0, 0]")));
  CHECK_THROWS_WITH(session_of(cut_block + replaced(disc_precut, "0.016]", "0.3]")),
                    Contains("case.toml:15") && Contains("precut[1]: lies outside the organ"));
  CHECK_THROWS_WITH(session_of(cut_block + replaced(disc_precut, "radius = 0.01", "radius = 1e-9")),
                    Contains("precut[1].radius = 1e-09 m: out of range"));
  CHECK_THROWS_WITH(session_of(cut_block + "[[precut]]\nshape = \"polygon\"\npoints = [[0, 0, 0.01], [0.01, 0, 0.01], "
                                           "[0.01, 0.01, 0.01], [0.01, 0.01, 0.01]]\n"),
                    Contains("precut[1]") && Contains("corners 3 and 4"));
  const std::string flat =
      "[[precut]]\nshape = \"polygon\"\npoints = [[0, 0, 0.01], [0.01, 0, 0.01], [0.02, 0, 0.01]]\n";
  CHECK_THROWS_WITH(session_of(cut_block + disc_precut + flat), Contains("case.toml:20: precut[2]"));
  CHECK_THROWS_WITH(
      session_of(replaced(replaced(cut_block, "fine_spacing = 0.005", ""), "coarse_spacing = 0.012", "") + flat),
      Contains("precut[1]") && Contains("enclose no area"));
  const TemporaryFolder folder;
  topology::SurfaceMesh plate; // two large triangles, a corner of which lies on the disc
  plate.vertices = {{0.006, 0, 0.016}, {0.026, 0, 0.016}, {0.026, 0.02, 0.016}, {0.006, 0.02, 0.016}};
  plate.triangles = {{0, 1, 2}, {0, 2, 3}};
  topology::write_surface(folder.path() / "plate.obj", plate);
  const auto overlapping = write_file(folder.path() / "overlapping.toml",
                                      cut_block + disc_precut + "[[precut]]\nshape = \"file\"\nfile = \"plate.obj\"\n");
  CHECK_THROWS_WITH(Session(read_scenario(overlapping)),
                    Contains("precut[2]") && Contains("of its area lie on the precuts before it"));
  topology::SurfaceMesh band; // of one side
  band.vertices = {{0, 0, 0.01}, {0, 0, 0.02}, {0.01, 0, 0.015}, {-0.01, 0.001, 0.015}, {0, 0.01, 0.015}};
  band.triangles = {{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {3, 4, 0}, {4, 0, 1}};
  topology::write_surface(folder.path() / "band.obj", band);
  const auto scenario =
      write_file(folder.path() / "case.toml", cut_block + "[[precut]]\nshape = \"file\"\nfile = \"band.obj\"\n");
  CHECK_THROWS_WITH(Session(read_scenario(scenario)), Contains("case.toml:15") && Contains("band.obj"));
}

TEST_CASE("More increments than memory allows are refused before the run") {
  CHECK_THROWS_WITH(
      session_of(cut_block + replaced(blade({"[0, 0, 9000]", "[0, 0, -9000]"}, 0.04, "0.5"), "step = 0.5\n", "")),
      Contains("case.toml:15") && Contains("triangles of cut") && Contains("500000"));
}

TEST_CASE("A body that follows the blade gives what building it anew on the same nodes gives") {
  const auto [method_name, sight, lips] =
      GENERATE(table<std::string, std::string, std::string>({{"galerkin", "appended", "open"},
                                                             {"galerkin", "appended", "frictionless"},
                                                             {"galerkin", "appended", "sticking"},
                                                             {"galerkin", "enriched", "frictionless"},
                                                             {"collocation", "enriched", "frictionless"}}));
  const std::string cut = "[cut]\nsight = \"" + sight + "\"\nlips = \"" + lips + "\"\n";
  Session session = session_of(long_block + "[method]\nname = \"" + method_name + "\"\n" + cut + incision_at_end);
  int updates = 0, rebuilds = 0;
  for (const StepSample& sample : session.steps()) {
    const StepResult result = session.step(sample);
    REQUIRE(result.cut);
    CHECK_FALSE(result.cut->refused);
    CHECK(result.residual < 1e-9);
    if (result.cut->triangles == 0)
      continue;
    updates += result.cut->update == SystemUpdate::updated ? 1 : 0;
    rebuilds += result.cut->update == SystemUpdate::rebuilt ? 1 : 0;
    CHECK(2 * result.cut->kept_nodes > result.cut->nodes);
    CHECK(session.model().body->problem().nodes.positions == session.model().sprinkling.nodes.positions);
    solvers::DiscretisationOptions method = session.scenario().method;
    method.unheld = session.scenario().cut.unheld;
    method.sight = sight_of(session.scenario());
    method.tip_functions = false;
    const auto anew = solvers::discretise(session.model().body->problem(), method);
    const solvers::Field expected = anew->solve();
    const solvers::Field followed = session.model().body->solve();
    // What a cut has appended may stand in another order.
    const VectorX moved = session.model().body->nodal_displacements(followed),
                  expected_moved = anew->nodal_displacements(expected);
    CHECK((moved - expected_moved).norm() < 1e-9 * expected_moved.norm());
    for (const Vector3& x : {Vector3(-0.03, 0.004, 0.02), Vector3(-0.05, -0.01, 0.025), Vector3(0.03, 0, 0.015)})
      CHECK((session.model().body->at(x, followed).displacement - anew->at(x, expected).displacement).norm() <
            1e-9 * expected_moved.lpNorm<Eigen::Infinity>());
  }
  CHECK((sight == "appended" ? updates : rebuilds) >= 2);
  CHECK((sight == "appended" || updates == 0));
  CHECK(session.model().field.coefficients.norm() > 0);
}

TEST_CASE("A run whose systems are updated tells of the same wound as one that rebuilds them") {
  Session updated = session_of(long_block + by_appending + incision_at_end);
  Session rebuilt = session_of(long_block + by_appending + incision_at_end);
  rebuilt.set_options({.updating = false});
  const std::vector<StepResult> a = run(updated);
  const std::vector<StepResult> b = run(rebuilt);
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(a[i].cut->update == (a[i].cut->triangles > 0 ? SystemUpdate::updated : SystemUpdate::none));
    CHECK(b[i].cut->update == (b[i].cut->triangles > 0 ? SystemUpdate::rebuilt : SystemUpdate::none));
    CHECK(a[i].cut->area == Approx(b[i].cut->area).epsilon(1e-6));
    CHECK(a[i].cut->pieces == b[i].cut->pieces);
    CHECK(a[i].nodes == b[i].nodes);
    CHECK(a[i].cut->opening == Approx(b[i].cut->opening).epsilon(1e-5).margin(1e-12));
    CHECK(a[i].cut->opening_volume == Approx(b[i].cut->opening_volume).epsilon(1e-5).margin(1e-15));
  }
}

TEST_CASE("A cut that appends is followed however far its blade goes in an increment, behind others bodies are made") {
  const std::string advance = GENERATE("0.1", "0.3");
  const bool appends = GENERATE(true, false);
  Session session = session_of(long_block + (appends ? by_appending : by_rebuilding) +
                               replaced(incision_at_end, "step = 0.2", "step = 0.1\nadvance = " + advance));
  int cuts = 0;
  for (const StepResult& result : run(session)) {
    CHECK_FALSE(result.cut->refused);
    if (result.cut->triangles == 0)
      continue;
    ++cuts;
    CHECK(result.cut->update == (appends ? SystemUpdate::updated : SystemUpdate::rebuilt));
    CHECK(result.cut->update_reason == (appends ? "" : "the body is made anew behind its cut"));
  }
  CHECK(cuts >= 3);
}

TEST_CASE("A session that is made ready follows its first cut by what that appends") {
  std::vector<SystemUpdate> first;
  for (const bool is_ready : {true, false}) {
    // At rest and free of loads: nothing else asks for a body.
    Session session =
        session_of(cut_block + by_appending + blade({"[0.004, 0, 0.036]", "[0.002, 0, 0.02]"}, 0.01, "0.2"));
    if (is_ready)
      session.prepare(session.steps().front());
    first.push_back(SystemUpdate::none);
    for (std::size_t i = 0; i < session.steps().size() && first.back() == SystemUpdate::none; ++i)
      first.back() = session.step(session.steps()[i]).cut->update;
  }
  CHECK(first == std::vector{SystemUpdate::updated, SystemUpdate::rebuilt});
}

TEST_CASE("Where an exchange takes away the last node of a fixed region all nodes are made anew, and the cut is made") {
  // Free of loads: a region that holds a node more changes nothing else.
  const std::string text = cut_block + by_rebuilding + R"([blade]
edge = [[0, 0, -0.009], [0, 0, 0.004]]
step = 0.05
[[blade.path]]
time = 0
position = [-0.033, 0.001, 0.03]
[[blade.path]]
time = 1
position = [0.012, 0.004, 0.03]
)";
  struct Step {
    std::vector<Vector3> carrying; // nodes of the surface
    bool exchanges = false;
  };
  std::vector<Step> steps;
  Session free = session_of(text);
  const auto look = [&](bool exchanges) {
    steps.push_back({{}, exchanges});
    const solvers::NodeCloud& nodes = free.model().sprinkling.nodes;
    for (int i = 0; i < nodes.size(); ++i)
      if (std::abs(free.organ().domain->signed_distance(nodes.positions[i])) < 1e-4)
        steps.back().carrying.push_back(nodes.positions[i]);
  };
  look(false);
  for (const StepSample& sample : free.steps())
    look(free.step(sample).cut->update_reason == "the body is made anew behind its cut");
  // A region that has nodes until an exchange takes them away.
  const auto emptied = [&](const Vector3& centre, double radius) {
    for (const Step& step : steps)
      if (std::none_of(step.carrying.begin(), step.carrying.end(),
                       [&](const Vector3& x) { return (x - centre).norm() <= radius; }))
        return step.exchanges;
    return false;
  };
  std::string region;
  double farthest = 0; // m, of its middle from the cut
  for (const double radius : {0.0003, 0.0006, 0.001, 0.0015, 0.002})
    for (const Step& step : steps)
      for (const Vector3& x : step.carrying) {
        const double away = (free.model().incision->closest(x, 1)->point - x).norm();
        if (away > farthest && emptied(x, radius)) {
          farthest = away;
          region = fmt::format("[[fixed]]\nregion = \"sphere\"\ncentre = [{}, {}, {}]\nradius = {}\naxes = [\"z\"]\n",
                               x.x(), x.y(), x.z(), radius);
        }
      }
  REQUIRE_FALSE(region.empty());
  Session held = session_of(replaced(text, "[nodes]", region + "[nodes]"));
  int renewed = 0;
  for (const StepResult& result : run(held)) {
    INFO(result.cut->reason);
    CHECK_FALSE(result.cut->refused);
    renewed += result.cut->update_reason.find("holds no surface node") != std::string::npos ? 1 : 0;
  }
  CHECK(renewed >= 1);
  CHECK(held.model().incision->area() == Approx(free.model().incision->area()).epsilon(1e-9));
}

TEST_CASE("A refused cut leaves a body that has followed the blade as it was, and the next motion makes up for it") {
  Session session = session_of(long_block + incision_at_end);
  std::size_t i = 0;
  for (; i < 4; ++i)
    session.step(session.steps()[i]);
  const VectorX coefficients = session.model().field.coefficients;
  const auto nodes = session.model().sprinkling.nodes.positions;
  const double area = session.model().incision->area();
  // A pose that no sweep can take.
  StepSample bad = session.steps()[i];
  bad.blade->position.x() = std::numeric_limits<double>::quiet_NaN();
  const StepResult refused = session.step(bad);
  REQUIRE(refused.cut->refused);
  CHECK(refused.cut->update == SystemUpdate::none);
  CHECK(session.model().field.coefficients == coefficients);
  CHECK(session.model().sprinkling.nodes.positions == nodes);
  CHECK(session.model().incision->area() == area);
}

TEST_CASE("Sessions in two threads at once give the bits of one alone") {
  const std::string text = long_block + incision_at_end;
  const auto coefficients_of = [&](VectorX& result) {
    Session session = session_of(text);
    run(session);
    result = session.model().field.coefficients;
  };
  VectorX alone, first, second;
  coefficients_of(alone);
  std::thread other([&] { coefficients_of(first); });
  coefficients_of(second);
  other.join();
  CHECK(first == alone);
  CHECK(second == alone);
}

TEST_CASE("The same cuts give the same bits") {
  const std::string text = stretched(cut_block) + slice;
  Session a = session_of(text);
  Session b = session_of(text);
  const std::vector<StepResult> first = run(a);
  const std::vector<StepResult> second = run(b);
  for (std::size_t i = 0; i < first.size(); ++i) {
    CHECK(first[i].cut->surface_hash == second[i].cut->surface_hash);
    CHECK(first[i].cut->opening == second[i].cut->opening);
    CHECK(first[i].cut->opening_volume == second[i].cut->opening_volume);
  }
  CHECK(a.model().field.coefficients == b.model().field.coefficients);
}

TEST_CASE("In the loop a body that follows its cut by what is appended gives the same bits") {
  const LoopRecords records =
      run_twice(scenario_of(long_block + by_appending + incision_at_end), regular_solves(1000, 125, 20), 1000);
  int updated = 0;
  for (const SolveRecord& solve : records.solves) {
    if (solve.update != "updated")
      continue;
    ++updated;
    CHECK(solve.residual > 0);
    CHECK(solve.residual < 1e-8);
  }
  CHECK(updated >= 3);
}
