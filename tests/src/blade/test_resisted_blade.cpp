// A blade that the tissue resists, in sessions: its force, the account of its work, and what it cuts.
#include "src/model/finite_model.hpp"
#include "src/session/session.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

bool tells_of_uncut_tissue(const std::string& warning) {
  return warning.find("tissue that it has not cut") != std::string::npos;
}

} // namespace

TEST_CASE(
    "A blade against tough tissue deforms it first, then cuts at toughness times width, and its work is accounted "
    "for") {
  const double toughness = 10, width = 0.06; // J/m2; m, of the block
  const std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                           "[cut]\nfront_spacing = 0.004\n" +
                           blade({"[0.004, 0, 0.031]", "[0.003, 0, 0.012]"}, 0.04, "0.125");
  Session session = session_of(text);
  const std::vector<StepResult> results = run(session);
  double area = 0, before = 0;
  bool cut = false;
  for (const StepResult& result : results) {
    const BladeReport& blade = result.cut->blade;
    CHECK(result.cut->area >= area); // and it lags behind the blade
    area = result.cut->area;
    if (!cut && area == 0)
      CHECK(blade.force.z() >= before); // upwards: it indents
    before = blade.force.z();
    cut = cut || area > 0;
    CHECK(blade.ledger.surface == Approx(toughness * area).epsilon(1e-9));
    CHECK(blade.ledger.imbalance() < 0.05);
    CHECK(result.residual < 1e-8);
  }
  REQUIRE(cut);
  CHECK(session.model().incision->front_length() == Approx(width).epsilon(0.01)); // from the surface on: none is buried
  const double swept = width * 0.018;
  CHECK(area < swept);
  CHECK(area > 0.5 * swept);
  const BladeReport& last = results.back().cut->blade;
  CHECK(last.force.z() == Approx(toughness * width).epsilon(0.25)); // not steady: the base is near
  CHECK(last.advance > 0);
  // The tissue is shown as the blade deforms it.
  CHECK(session.model().at({0.003, 0, 0.011}).displacement.z() < -0.1 * last.advance);
}

TEST_CASE("A blade that comes in along its own edge cuts where it is drawn across, beside a probe as well") {
  // What a probe moves bends the way that the blade has come in on: it has cut a splinter's worth there.
  const std::string block =
      "[organ]\nshape = \"block\"\nsize = [0.06, 0.06, 0.03]\nedge = 0.006\n[material]\nyoung_modulus = "
      "1e4\npoisson_ratio = 0.3\ntoughness = 2\n[[fixed]]\nregion = \"half_space\"\npoint = [-0.029, 0, 0]\nnormal "
      "= [1, 0, 0]\n[[fixed]]\nregion = \"half_space\"\npoint = [0.029, 0, 0]\nnormal = [-1, 0, 0]\n[nodes]\n"
      "fine_spacing = 0.007\ncoarse_spacing = 0.014\nfine_radius = 0.008\n"
      "[tool]\nshape = \"sphere_tip\"\nradius = 0.01\nstep = 0.1\n[[tool.path]]\ntime = 0\nposition = [-0.014, 0.001, "
      "0.034]\n[[tool.path]]\ntime = 1\nposition = [-0.014, 0.001, DOWN]\n[blade]\nedge = [[0, 0, 0], [0, 0, 0.03]]\n";
  const auto pose = [](double time, double x, double y, double z) {
    return "[[blade.path]]\ntime = " + std::to_string(time) + "\nposition = [" + std::to_string(x) + ", " +
           std::to_string(y) + ", " + std::to_string(z) + "]\n";
  };
  std::string trembling, slanted; // on the way in
  for (int k = 0; k <= 10; ++k) {
    const double time = 1 + 0.1 * k, z = 0.035 - 0.00135 * k;
    trembling += pose(time, 0.013 + (k % 2 == 0 ? 5e-5 : -5e-5), 0.008 + (k % 3 == 0 ? 5e-5 : -5e-5), z);
    slanted += pose(time, 0.013, 0.008 - 5e-5 * k, z);
  }
  const std::string straight = pose(1, 0.013, 0.008, 0.035) + pose(2, 0.013, 0.008, 0.0215),
                    across = pose(4, 0.013, -0.014, 0.0215);
  for (const std::string& way :
       {"step = 0.1\n" + straight, straight, "step = 0.1\n" + trembling, "step = 0.1\n" + slanted})
    for (const std::string down : {"0.0339", "0.0256"}) {
      Session session = session_of(replaced(block, "DOWN", down) + way + across);
      const std::vector<StepResult> results = run(session);
      const BladeReport& last = results.back().cut->blade;
      const auto in = std::find_if(results.begin(), results.end(), [](const StepResult& r) { return r.time > 1.99; });
      CAPTURE(way, down, results.back().cut->area, last.force.transpose());
      CHECK(in->cut->area < 1e-6); // it has come in
      CHECK(results.back().cut->area > 0.85 * 0.0085 * 0.0215);
      CHECK(last.ledger.work == Approx(2 * results.back().cut->area).epsilon(0.1));
      CHECK(last.edge_force < 2 * 2 * 0.0085);
      CHECK(std::none_of(session.warnings().begin(), session.warnings().end(), [](const std::string& warning) {
        return warning.find("the cut does not come") != std::string::npos;
      }));
    }
}

TEST_CASE("A blade that is pressed too little does not cut, and leaves nothing behind") {
  const std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 200") +
                           blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.028]", "[0.004, 0, 0.035]"}, 0.04, "0.5");
  Session session = session_of(text);
  const std::vector<StepResult> results = run(session);
  CHECK(session.model().incision == nullptr);
  CHECK(results[2].cut->blade.force.z() > 0);
  CHECK(results.back().cut->blade.force.norm() == 0);
  CHECK(session.model().at({0.004, 0, 0.029}).displacement.norm() < 1e-12);
  CHECK(std::none_of(session.warnings().begin(), session.warnings().end(), tells_of_uncut_tissue));
}

TEST_CASE("A blade that comes back into its own cut meets nothing before it has gone through it, then cuts on") {
  const std::string text =
      replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
      "[cut]\nfront_spacing = 0.004\n" +
      blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.02]", "[0.004, 0, 0.034]", "[0.004, 0, 0.015]"}, 0.04, "0.05");
  Session session = session_of(text);
  double area = 0, depth = 0, work = 0;
  bool was_out = false;
  StepResult last;
  for (const StepSample& sample : session.steps()) {
    last = session.step(sample);
    const double z = sample.blade->position.z();
    if (last.cut->area > 0)
      CHECK(last.cut->blade.ledger.imbalance() < 0.05);
    if (!was_out) {
      was_out = z > 0.033;
      area = last.cut->area;
      depth = area / 0.06;
      work = last.cut->blade.ledger.work;
    } else if (z > 0.0305 - depth) { // down to the front that it has left
      CHECK(last.cut->blade.force.norm() == 0);
      CHECK(last.cut->area == area);
      CHECK(last.cut->blade.ledger.work == work);
    }
  }
  REQUIRE(was_out);
  REQUIRE(depth > 0.005);
  CHECK(last.cut->area > area + 0.06 * 0.003);
  CHECK(last.cut->blade.release == Approx(10).epsilon(0.3));
}

TEST_CASE("A resisted blade's steady force is toughness times width in short steps, too") {
  Session session =
      session_of(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 5") +
                 "[cut]\nfront_spacing = 0.004\n" + blade({"[0.001, 0, 0.0325]", "[0.001, 0, 0.0225]"}, 0.04, "0.025"));
  double sum = 0;
  int steps = 0;
  const std::vector<StepResult> results = run(session);
  for (const StepResult& result : results)
    if (result.time > 0.6) {
      sum += result.cut->blade.force.z();
      ++steps;
    }
  const solvers::BladeLedger ledger = results.back().cut->blade.ledger;
  CHECK(ledger.excess < 0.1 * ledger.surface);
  CHECK(sum / steps == Approx(5 * 0.06).epsilon(0.2));
}

TEST_CASE("The flanks of a blade drag against its motion, forwards and back") {
  Session session =
      session_of(replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                 "[cut]\nfront_spacing = 0.004\n" +
                 replaced(blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.015]", "[0.004, 0, 0.035]"}, 0.04, "0.1"),
                          "[blade]\n", "[blade]\nfriction = 500\nflank = 0.006\n"));
  double spent = 0; // J, of the blade's work, on anything but elastic energy, which the turn gives back
  int back = 0;
  for (const StepResult& result : run(session)) {
    const BladeReport& blade = result.cut->blade;
    CHECK(blade.ledger.work - blade.ledger.stored >= spent - 1e-12);
    spent = blade.ledger.work - blade.ledger.stored;
    const double drag = blade.force.z() - blade.edge_force;
    if (result.time > 0.6 && result.time < 0.95)
      CHECK(drag > 0.05); // N, upwards on a blade that goes down
    if (result.time > 1.15 && blade.force.norm() > 0) {
      CHECK(blade.force.z() < -0.05);
      ++back;
    }
  }
  CHECK(back > 0);
}

TEST_CASE("Where little force cuts, a resisted blade cuts at that force in short steps, too") {
  const std::string text = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 0.5") +
                           "[cut]\nfront_spacing = 0.004\n" +
                           blade({"[0.004, 0, 0.0305]", "[0.004, 0, 0.0235]"}, 0.04, "0.025");
  Session session = session_of(text);
  StepResult last;
  double most = 0;
  for (const StepSample& sample : session.steps()) {
    last = session.step(sample);
    if (last.cut->area > 0.06 * 0.003) // past the first cut
      most = std::max(most, last.cut->blade.release);
  }
  const solvers::BladeLedger& ledger = last.cut->blade.ledger;
  REQUIRE(last.cut->area > 0.06 * 0.005);
  CHECK(ledger.work < 1.15 * (ledger.surface + ledger.stored));
  CHECK(most < 5 * 0.5);
}

TEST_CASE("A resisted blade that pushes the far side of an organ out goes on until it has cut that, too") {
  const double toughness = 10; // J/m2
  const std::string text = replaced(replaced(cut_block, "size = [0.06, 0.06, 0.03]", "size = [0.04, 0.03, 0.03]"),
                                    "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                           "[cut]\nfront_spacing = 0.005\nunheld = \"hold\"\n" +
                           blade({"[-0.024, 0, 0.02]", "[0.027, 0, 0.02]"}, 0.02, "0.1");
  Session session = session_of(text);
  const std::vector<StepResult> results = run(session);
  double before = 0;
  for (const StepResult& result : results) {
    const BladeReport& blade = result.cut->blade;
    CHECK(blade.force.x() <= 1e-12); // against its motion
    CHECK(blade.ledger.work >= before - 1e-12);
    before = blade.ledger.work;
  }
  const CutReport& last = *results.back().cut;
  CHECK(last.pieces == 2);
  CHECK(last.area == Approx(0.04 * 0.03).epsilon(1e-3));
  CHECK(last.front_length == 0);
  CHECK(last.blade.force.norm() == 0);
  CHECK(last.blade.ledger.surface == Approx(toughness * last.area).epsilon(1e-9));
  CHECK(last.blade.ledger.stored == 0);
  CHECK(last.blade.ledger.work == Approx(last.blade.ledger.surface).epsilon(0.1));
  CHECK(last.blade.ledger.imbalance() < 0.03);
  CHECK(std::none_of(session.warnings().begin(), session.warnings().end(), tells_of_uncut_tissue));
}

TEST_CASE("Tissue that a resisted blade has gone through without cutting it is told") {
  const std::string tough = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 20000");
  SECTION("where it presses too little to cut, and comes out at the other side") {
    Session session =
        session_of(tough + blade({"[0.004, 0, 0.031]", "[0.004, 0, 0.028]", "[0.004, 0, -0.005]"}, 0.04, "0.5"));
    run(session);
    CHECK(session.model().incision == nullptr);
    CHECK(std::any_of(session.warnings().begin(), session.warnings().end(), tells_of_uncut_tissue));
  }
  SECTION("where it goes from outside to outside in one step") {
    Session session = session_of(tough + blade({"[0.004, 0, 0.031]", "[0.004, 0, -0.005]"}, 0.04, "1"));
    run(session);
    REQUIRE(session.model().incision == nullptr);
    const auto told = std::find_if(session.warnings().begin(), session.warnings().end(), tells_of_uncut_tissue);
    REQUIRE(told != session.warnings().end());
    CHECK_THAT(*told, Contains("up to 30 mm") && Contains("blade.step"));
  }
  SECTION("but not where it goes by") {
    Session session =
        session_of(tough + blade({"[0.004, 0, 0.031]", "[0.2, 0, 0.031]", "[0.2, 0, -0.005]"}, 0.04, "0.5"));
    run(session);
    CHECK(std::none_of(session.warnings().begin(), session.warnings().end(), tells_of_uncut_tissue));
  }
}

TEST_CASE("A blade that tissue resists cuts on in steps between which its last cut added nothing to the sheet") {
  // Tilted, so that its first strip is narrower than what a later motion adds at first.
  Session session = session_of(R"([organ]
shape = "block"
size = [0.06, 0.03, 0.03]
[material]
young_modulus = 1e4
poisson_ratio = 0.3
toughness = 5
pretension = [0.05, 0, 0]
[[fixed]]
region = "half_space"
point = [0, 0, 0.0005]
normal = [0, 0, 1]
[nodes]
coarse_spacing = 0.006
[cut]
front_spacing = 0.003
lips = "frictionless"
[blade]
edge = [[0, -0.02, 0], [0, 0.02, 0]]
step = 0.05
[[blade.path]]
time = 0
position = [0, 0, 0.034]
rotation = [4, 0, 0]
[[blade.path]]
time = 0.5
position = [0, 0, 0.018]
rotation = [4, 0, 0]
)");
  double work = 0;
  StepResult last;
  for (const StepSample& sample : session.steps()) {
    last = session.step(sample);
    CHECK_FALSE(last.cut->refused);
    CHECK(std::isfinite(last.cut->blade.force.norm()));
    CHECK(last.cut->blade.ledger.work >= work * (1 - 1e-9));
    work = last.cut->blade.ledger.work;
  }
  // All but the edge's lag behind the way of 12 mm from surface to end, 30 mm wide.
  CHECK(last.cut->area > 0.8 * 0.012 * 0.03);
  CHECK(work > 5 * last.cut->area);
}

namespace {

/// A strip of 80 x 10 x 40 mm between clamps above and below, strained across by `strain`, whose sides do not go
/// outwards; a slit along its middle from one end, and a blade that cuts on from there. It releases (lambda + 2 mu)
/// strain^2 H / 2 per m2 where both halves are free behind the front.
std::string stretched_strip(double strain, const std::string& law) {
  std::string text = "[organ]\nshape = \"block\"\nsize = [0.08, 0.01, 0.04]\nedge = 0.005\n[material]\n" + law +
                     "young_modulus = 10000\npoisson_ratio = 0.3\ntoughness = 10\npretension = [0, 0, " +
                     std::to_string(strain) + "]\n";
  const auto held = [&](const std::string& point, const std::string& normal, const std::string& axes) {
    text += "[[fixed]]\nregion = \"half_space\"\npoint = " + point + "\nnormal = " + normal + axes;
  };
  held("[0, 0, 0.0005]", "[0, 0, 1]\n", "");
  held("[0, 0, 0.0395]", "[0, 0, -1]\n", "");
  held("[0, -0.0049, 0]", "[0, 1, 0]\n", "axes = [\"y\"]\n");
  held("[0, 0.0049, 0]", "[0, -1, 0]\n", "axes = [\"y\"]\n");
  return text +
         "[nodes]\nfine_spacing = 0.0035\ncoarse_spacing = 0.008\n[[precut]]\nshape = \"rectangle\"\ncentre = [-0.04, "
         "0, "
         "0.0211]\nnormal = [0, 0, 1]\nup = [1, 0, 0]\nwidth = 0.03\nheight = 0.05\n" +
         blade({"[-0.017, 0, 0.0211]", "[0.012, 0, 0.0211]"}, 0.009, "0.05");
}

} // namespace

TEST_CASE("A blade that goes on in a slit cuts from its front, and tension pays for its cut") {
  constexpr double modulus = 1e4 * 0.7 / (1.3 * 0.4), height = 0.04, toughness = 10; // lambda + 2 mu, Pa; m; J/m2
  for (const double strain : {0.0, 0.1, 0.14}) {
    Session session = session_of(stretched_strip(strain, ""));
    const std::vector<StepResult> results = run(session);
    const CutReport& last = *results.back().cut;
    CHECK(results.front().cut->area == Approx(0.01 * 0.025).epsilon(1e-3));
    CHECK(last.area == Approx(0.01 * (0.04 + 0.012)).epsilon(0.01)); // and not once more where the slit was
    const auto from =
        std::find_if(results.begin(), results.end(), [](const StepResult& r) { return r.cut->area > 0.01 * 0.031; });
    REQUIRE(from != results.end());
    const double paid = (last.blade.ledger.work - from->cut->blade.ledger.work) / (last.area - from->cut->area);
    INFO("strain " << strain);
    CHECK(paid == Approx(toughness - 0.5 * modulus * strain * strain * height).margin(0.03 * toughness));
  }
}

TEST_CASE("A front that tension alone would drive on is told where a blade is at it and nothing tears") {
  Session session = session_of(stretched_strip(0.22, ""));
  run(session);
  CHECK(std::any_of(session.warnings().begin(), session.warnings().end(), [](const std::string& warning) {
    return warning.find("it would run ahead") != std::string::npos;
  }));
}

TEST_CASE("A blade that cuts beside a grasper pushes on what that holds, by either law alike") {
  std::array<StepResult, 2> last;
  for (const std::size_t finite : {0U, 1U}) {
    Session session = session_of(lifted_flap(finite == 1 ? "law = \"neo_hookean\"\n" : "", 0.0005));
    last[finite] = run(session).back();
    if (finite == 1)
      continue;
    const BodyModel& model = session.model(); // under the blade
    const MatrixX moved = model.body->contact_displacements(model.patch.nodes, {model.field});
    REQUIRE(!model.patch.nodes.empty());
    for (Eigen::Index c = 0; c < moved.rows(); c += 3)
      CHECK((moved.col(0).segment<3>(c) - Vector3(0, 0, 0.0005)).norm() < 1e-8);
  }
  CHECK(last[0].force.x() > 0.001); // N: the blade drags the flap along
  CHECK((last[0].force - last[1].force).norm() < 0.15 * last[1].force.norm());
  CHECK(last[0].cut->blade.ledger.work == Approx(last[1].cut->blade.ledger.work).epsilon(0.05));
}

TEST_CASE("A grasper holds its patch under the blade where sides are held along an axis, too") {
  std::string sides;
  for (const int side : {-1, 1})
    sides += "[[fixed]]\nregion = \"half_space\"\npoint = [0, " + std::to_string(side * 0.0079) +
             ", 0]\nnormal = [0, " + std::to_string(-side) + ", 0]\naxes = [\"y\"]\n";
  Session session = session_of(lifted_flap("", 0.0005) + sides);
  const StepResult last = run(session).back();
  const BodyModel& model = session.model();
  const MatrixX moved = model.body->contact_displacements(model.patch.nodes, {model.field});
  for (Eigen::Index c = 0; c < moved.rows(); c += 3)
    CHECK((moved.col(0).segment<3>(c) - Vector3(0, 0, 0.0005)).norm() < 1e-8);
  CHECK(last.force.x() > 0.001);
  CHECK(last.cut->blade.ledger.imbalance() < 0.05);
}

TEST_CASE("A grasper that lets go while the blade rests in the tissue is free of force, and the blade stays") {
  const std::string flap = lifted_flap("", 0.002);
  Session session = session_of(replaced(flap, "shape = \"grasper\"\n", "shape = \"grasper\"\nrelease = 2.4\n") +
                               "\n[[tool.path]]\ntime = 3\nposition = [-0.03, 0, 0.03]\n");
  double before = 0;
  for (const StepSample& sample : session.steps()) {
    const StepResult result = session.step(sample);
    if (sample.time > 2 && sample.time < 2.4) {
      before = result.cut->blade.edge_force;
      CHECK(result.force.norm() > 1e-3);
    }
    if (sample.time > 2.4) {
      CHECK(result.force.norm() == 0);
      CHECK(result.cut->blade.edge_force > 0.2 * before); // the flap gives way
      CHECK(result.cut->blade.edge_force < before);
    }
  }
  CHECK(before > 0);
}

TEST_CASE("At finite strain, too, what a grasper's pull releases pays for a blade's cut") {
  Session session = session_of(lifted_flap("law = \"neo_hookean\"\n", 0.006));
  double held = 0, area = 0;
  StepResult last;
  for (const StepSample& sample : session.steps()) {
    last = session.step(sample);
    if (sample.time == 1) {
      held = session.model().finite->last().energy;
      area = last.cut->area;
    }
  }
  const solvers::BladeLedger& ledger = last.cut->blade.ledger;
  const double stored = session.model().finite->last().energy; // with what the blade stores
  const double spent = 2 * (last.cut->area - area);
  CHECK(held > 6e-5);
  CHECK(spent > 2e-4);
  CHECK(ledger.work < 0.85 * spent);
  CHECK(ledger.work - ledger.excess - (stored - held) == Approx(spent).epsilon(0.06));
}
