#include "experiments/analytic/cracks.hpp"
#include "experiments/support/straight_crack.hpp"
#include "solvers/appended/appended_body.hpp"
#include "tests/solvers/growing_scene.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

DiscretisationOptions appending(UnheldPieces unheld = UnheldPieces::refuse) {
  DiscretisationOptions options;
  options.sight = SightRule::appended;
  options.unheld = unheld;
  options.estimate_condition = false;
  return options;
}

const experiments::CutFrame appended_plane = experiments::tilted_frame({0.02, -0.03, 0.04}, {0.15, -0.1, 0.2});

bool is_above_cut(const Vector3& x) {
  return appended_plane.local(x)[1] > 0;
}

/// A cube of 1 m that a tilted plane cuts in two.
experiments::CutBody appended_cube(int nodes = 350) {
  experiments::CutBodyCase cut;
  cut.domain = topology::make_box_domain({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 0.2);
  cut.sheets = {
      topology::make_rectangle_sheet(appended_plane.origin, appended_plane.normal, appended_plane.ahead, 2, 2, 0.25)};
  cut.coarse = 1;
  cut.nodes = nodes;
  cut.sight = SightRule::appended;
  experiments::CutBody body = experiments::cut_body(cut);
  body.problem.material = {1, 0.3, 0};
  return body;
}

Vector3 total_of(const std::vector<Vector3>& forces) {
  Vector3 total = Vector3::Zero();
  for (const Vector3& force : forces)
    total += force;
  return total;
}

/// Block with a growing cut whose lip nodes are places.
struct AppendingScene : tests::GrowingScene {
  AppendingScene() : GrowingScene(Method::galerkin, true) {}
};

/// The block of a scene on nodes that know of no cut, its bottom held.
Problem without_cut(const AppendingScene& scene) {
  SprinkleOptions uncut = scene.sprinkling;
  uncut.incision = nullptr;
  Problem problem = scene.problem();
  problem.nodes = sprinkle(*scene.domain, uncut).nodes;
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != NodeKind::interior && problem.nodes.positions[i].z() < -0.03 + 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  return problem;
}

std::vector<int> nodes_on_top(const NodeCloud& nodes, int count) {
  std::vector<int> top;
  for (int i = 0; i < nodes.size() && std::ssize(top) < count; ++i)
    if (nodes.kinds[i] == NodeKind::surface && nodes.normals[i].z() > 0.9)
      top.push_back(i);
  return top;
}

} // namespace

TEST_CASE("A cut that appends parts a body completely") {
  experiments::CutBody body = appended_cube();
  const auto motion = [](const Vector3& x) -> Vector3 {
    return is_above_cut(x) ? Vector3(Vector3(0.1, -0.2, 0.3) + Vector3(0.4, 0.1, -0.5).cross(x))
                           : Vector3(Vector3::Zero());
  };
  experiments::hold_surface(
      body.problem, [](const Vector3& x, const Vector3& n) { return std::abs(n.z()) > 0.5 && std::abs(x.z()) > 0.49; },
      motion);
  const auto cut = discretise(body.problem, appending());
  REQUIRE(cut->report().pieces.size() == 2);
  const VectorX u = cut->nodal_displacements(cut->solve());
  double moved = 0, still = 0;
  for (int i = 0; i < body.problem.nodes.size(); ++i) {
    const Vector3& x = body.problem.nodes.positions[i];
    double& error = is_above_cut(x) ? moved : still;
    error = std::max(error, (u.segment<3>(3 * i) - motion(x)).norm());
  }
  CHECK(moved < 1e-9);
  CHECK(still < 1e-10);

  // A force on one half does nothing to the other.
  std::vector<int> above, below;
  for (int i = 0; i < body.problem.nodes.size(); ++i)
    if (body.problem.nodes.kinds[i] == NodeKind::surface && std::abs(body.problem.nodes.normals[i].z()) < 0.5)
      (is_above_cut(body.problem.nodes.positions[i]) ? above : below).push_back(i);
  REQUIRE(above.size() > 20);
  REQUIRE(below.size() > 20);
  const MatrixX own = cut->contact_compliance(above);
  const MatrixX across = cut->compliance_between(below, above);
  CHECK(across.cwiseAbs().maxCoeff() < 1e-14 * own.cwiseAbs().maxCoeff());
}

TEST_CASE("A sheet with sharp bends parts a body completely") {
  // A blade that leaves an earlier cut in moved tissue makes steps of a part of a box and bends of 60 degrees and more.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> in(0, 1);
  experiments::CutBody body = appended_cube();
  for (int trial = 0; trial < 12; ++trial) {
    std::vector<Vector3> profile{{-0.6, 0, 0.2 * in(random)-0.1}};
    while (profile.back().x() < 0.6) { // steps up and down in turns, with a piece between two of them
      const double height = 0.01 + 0.07 * in(random), way = (0.1 + in(random)) * height;
      const double to = profile.back().z() + (profile.size() % 4 == 3 ? -height : height);
      profile.emplace_back(profile.back().x() + 0.02 + 0.2 * in(random), 0, profile.back().z());
      profile.emplace_back(profile.back().x() + way, 0, to);
    }
    constexpr int rows = 9;
    topology::SurfaceMesh sheet;
    for (const Vector3& x : profile)
      for (int row = 0; row < rows; ++row)
        sheet.vertices.emplace_back(x.x() + 0.02 * row / rows, -0.6 + 1.2 * row / (rows - 1), x.z());
    for (int k = 0; k + 1 < std::ssize(profile); ++k)
      for (int row = 0; row + 1 < rows; ++row) {
        const int v = rows * k + row;
        sheet.triangles.push_back({v, v + rows, v + 1});
        sheet.triangles.push_back({v + 1, v + rows, v + rows + 1});
      }
    for (const Vector3& x : profile)
      REQUIRE(std::abs(x.z()) < 0.45);
    Problem problem = body.problem;
    problem.incision = std::make_shared<const topology::Incision>(std::vector{sheet}, problem.domain);
    experiments::hold_surface(
        problem, [](const Vector3& x, const Vector3& n) { return std::abs(n.z()) > 0.5 && std::abs(x.z()) > 0.49; },
        [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
    INFO("trial " << trial);
    CHECK(discretise(problem, appending())->report().pieces.size() == 2);
  }
}

TEST_CASE("A straight crack that is appended opens as it should") {
  const experiments::CutFrame& crack = experiments::straight_crack_frame();
  experiments::CutBody body = experiments::straight_crack_body(1, 0.3, Method::galerkin, SightRule::appended);
  const Material material = body.problem.material;
  Intensities acting = Vector3::Zero();
  experiments::hold_whole_surface(body.problem, [&](const Vector3& x) {
    return experiments::straight_crack_displacement(material, crack, acting, x);
  });
  const auto cut = discretise(body.problem, appending());
  const auto& appended = dynamic_cast<const AppendedBody&>(*cut);
  const std::array<int, 3> component{1, 0, 2};            // in the axes ahead, normal, along
  const std::array<double, 3> bound{0.012, 0.018, 0.014}; // twice what the median of ten node sets may be
  for (int mode = 0; mode < 3; ++mode) {
    acting = Vector3::Unit(mode);
    const Field field = cut->solve();
    CHECK(cut->residual(field) < 1e-9);
    double error = 0, size = 0;
    for (int i = 0; i < 30; ++i)
      for (const double along : {-0.3, 0.0, 0.3}) {
        const double s = 0.8 * std::pow((i + 0.5) / 30, 2);
        const Vector3 x = crack.origin - s * crack.ahead + along * crack.tangent;
        const double opening = crack.local(
            crack.origin + experiments::opening_at(*cut, field, x, crack.normal, body.fine))[component[mode]];
        const double exact = 2 * tip_field(material, acting, -s, 1e-15 * s).displacement[component[mode]];
        error += (opening - exact) * (opening - exact);
        size += exact * exact;
      }
    CHECK(std::sqrt(error / size) < bound[mode]);
    Intensities integral = Vector3::Zero(), read = Vector3::Zero();
    const auto fronts = front_samples(*body.problem.incision, 0.2, 0.25);
    for (const topology::FrontFrame& front : fronts) {
      integral += interaction_integral(*cut, field, front) / static_cast<double>(fronts.size());
      read += appended.front_intensities(field, front) / static_cast<double>(fronts.size());
      // The rule is the same as a linear function of the field.
      CHECK((interaction_rule(*cut, false, front)(field) - interaction_integral(*cut, field, front)).norm() < 1e-9);
    }
    CHECK((integral - acting).norm() < 0.03);
    CHECK((read - acting).norm() < 0.08);
  }
}

TEST_CASE("A pressurised penny that is appended opens by the right volume") {
  const double nu = GENERATE(0.3, 0.49);
  const experiments::CutFrame crack = experiments::tilted_frame({0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});
  experiments::CutBodyCase cut;
  cut.domain = topology::make_box_domain(Vector3(-2, -2, -2), Vector3(2, 2, 2), 0.5);
  cut.sheets = {topology::make_disc_sheet(crack.origin, crack.normal, 1, 0.1)};
  cut.slope = 0.25 * std::cbrt(2400.0 / 800);
  cut.nodes = 800;
  cut.sight = SightRule::appended;
  experiments::CutBody body = experiments::cut_body(cut);
  body.problem.material = {1, nu, 0};
  const Material material = body.problem.material;
  experiments::hold_whole_surface(
      body.problem, [&](const Vector3& x) { return experiments::penny_displacement(material, crack, 1, 1, x); });
  body.problem.loads.lip_traction = [](const Vector3&, const Vector3& n) -> Vector3 { return -n; };
  const auto penny = discretise(body.problem, appending());
  const Field field = penny->solve();
  double volume = 0;
  constexpr int rings = 20, sectors = 12;
  for (int a = 0; a < rings; ++a)
    for (int b = 0; b < sectors; ++b) {
      const double t = 0.5 * std::numbers::pi * (a + 0.5) / rings, w = 2 * std::numbers::pi * (b + 0.5) / sectors,
                   r = std::sin(t);
      const double area = r * std::cos(t) * (0.5 * std::numbers::pi / rings) * (2 * std::numbers::pi / sectors);
      const Vector3 x = crack.origin + r * (std::cos(w) * crack.ahead + std::sin(w) * crack.tangent);
      volume += area * experiments::opening_at(*penny, field, x, crack.normal, body.fine).dot(crack.normal);
    }
  CHECK(volume == Approx(experiments::penny_opening_volume(material, 1, 1)).epsilon(0.015));
}

TEST_CASE("A sphere whose rim comes near a front that lies outside of it has a twin all the same") {
  // On this node set one sphere, 0.4 m behind the front, holds the cut, and a box at its rim holds the front.
  const experiments::CutFrame& crack = experiments::straight_crack_frame();
  experiments::CutBody body = experiments::straight_crack_body(5, 0.3, Method::galerkin, SightRule::appended);
  const Material material = body.problem.material;
  const Intensities opens = Vector3::UnitX();
  experiments::hold_whole_surface(body.problem, [&](const Vector3& x) {
    return experiments::straight_crack_displacement(material, crack, opens, x);
  });
  const auto cut = discretise(body.problem, appending());
  const Field field = cut->solve();
  for (const double behind : {0.3, 0.36, 0.42, 0.48}) {
    const Vector3 x = crack.origin - behind * crack.ahead - 0.32 * crack.tangent;
    const double opening = experiments::opening_at(*cut, field, x, crack.normal, body.fine).dot(crack.normal);
    INFO(behind << " m behind the front");
    CHECK(opening == Approx(2 * tip_field(material, opens, -behind, 1e-15).displacement[1]).epsilon(0.03));
  }
}

TEST_CASE("The front of a sheet that runs on is one run, also where its pieces differ by rounding") {
  // The border of this sheet leaves and enters the body at its surface: pieces of it are found one by one.
  const experiments::CutBody body = experiments::straight_crack_body(1, 0.3, Method::galerkin, SightRule::appended);
  const FrontRuns runs(body.problem.incision);
  REQUIRE(runs.count() == 1);
  CHECK(runs.runs()[0].segments.size() == body.problem.incision->front().size());
  CHECK_FALSE(runs.runs()[0].closed);
}

TEST_CASE("Places with respect to one front do not notice another one") {
  // Two slits side by side, whose fronts lie along y at x = 0 and at x = 0.4, at heights 0 and 0.1.
  const auto domain = topology::make_box_domain({-1, -0.5, -1}, {1, 0.5, 1}, 0.2);
  const auto slit = [](double from, double to, double height) {
    return topology::make_rectangle_sheet({0.5 * (from + to), 0, height}, Vector3::UnitZ(), Vector3::UnitX(), 1.4,
                                          to - from, 0.1);
  };
  const auto incision =
      std::make_shared<const topology::Incision>(std::vector{slit(-1.2, 0, 0), slit(0.4, 1.2, 0.1)}, domain);
  const FrontRuns runs(incision);
  REQUIRE(runs.count() == 2);
  int left = 0; // the run at x = 0
  if (std::abs(incision->front()[runs.runs()[0].segments[0]].from.x()) > 0.1)
    left = 1;
  double before = 0;
  for (int k = 0; k <= 100; ++k) { // past the middle between the fronts, and over the other slit
    const Vector3 x(0.1 + 0.005 * k, 0.03, 0.08);
    const auto place = runs.place(left, x, 3);
    REQUIRE(place);
    CHECK(place->ahead == Approx(x.x()).margin(1e-9));
    CHECK(std::abs(place->above) == Approx(x.z()).margin(1e-9));
    if (k > 0)
      CHECK(place->above == Approx(before).margin(1e-9));
    before = place->above;
  }
  CHECK(front_place(*incision, {0.5, 0.03, 0.08}, 3)->ahead < 0); // the other slit's front is the nearest
  CHECK_FALSE(runs.place(left, {0.9, 0.03, 0.08}, 0.5));
}

TEST_CASE("A body whose cut has grown by appending equals one that was cut at once") {
  AppendingScene scene;
  DiscretisationOptions options = appending();
  options.tip_functions = GENERATE(true, false);
  const auto follows = discretise(scene.problem(), options);
  auto& body = dynamic_cast<AppendedBody&>(*follows);
  for (int increment = 0; increment < 4; ++increment) {
    const SprinkleIncrement change = scene.grow();
    CHECK(change.removed.empty());
    CHECK(change.added.size() > 0);
    REQUIRE(body.grow(change, scene.problem()).empty());
    REQUIRE(body.problem().nodes.positions == scene.nodes.positions);
    const Field field = body.solve();
    CHECK(body.residual(field, {}, {}) < 1e-9);
    const AppendedBody at_once(scene.problem(), options, body.uncut());
    const Field expected = at_once.solve();
    const VectorX grown = body.nodal_displacements(field), fresh = at_once.nodal_displacements(expected);
    CHECK((grown - fresh).norm() < 1e-8 * fresh.norm());
    const std::vector<int> top = nodes_on_top(scene.nodes, 12);
    const MatrixX compliance = body.contact_compliance(top);
    CHECK((compliance - at_once.contact_compliance(top)).norm() < 1e-8 * compliance.norm());
    std::vector<int> lips;
    for (int i = base_nodes(scene.nodes); i < scene.nodes.size(); ++i)
      lips.push_back(i);
    REQUIRE_FALSE(lips.empty());
    const MatrixX means = at_once.contact_displacements(lips, {expected});
    CHECK((body.contact_displacements(lips, {field}) - means).norm() < 1e-8 * means.norm());
  }
}

TEST_CASE("In graded nodes, too, a body that has grown by small increments equals one that was cut at once") {
  AppendingScene scene;
  scene.sprinkling.spacing = {.fine = 0.004, .coarse = 0.02, .slope = 0.5, .radius = 0.004, .centres = {{-0.02, 0, 0}}};
  scene.nodes = sprinkle(*scene.domain, scene.sprinkling).nodes;
  DiscretisationOptions options = appending();
  options.tip_functions = false;
  AppendedBody body(scene.problem(), options);
  for (int increment = 0; increment < 10; ++increment) {
    const SprinkleIncrement change = scene.grow();
    REQUIRE(body.grow(change, scene.problem()).empty());
    const AppendedBody at_once(scene.problem(), options, body.uncut());
    CHECK(body.space().functions().size() == at_once.space().functions().size());
    const VectorX grown = body.nodal_displacements(body.solve()), fresh = at_once.nodal_displacements(at_once.solve());
    CHECK((grown - fresh).norm() < 1e-8 * fresh.norm());
  }
}

TEST_CASE("Steps go with their fronts where another front goes and runs get other numbers") {
  const AppendingScene scene;
  const auto cut_to = [&](double through, double depth) { // the first sheet severs the block where it goes through it
    const Vector3 normal = Vector3::UnitX(), up = Vector3::UnitZ();
    const std::vector<topology::SurfaceMesh> sheets{
        topology::make_rectangle_sheet({-0.0203, 0.5 * (through - 0.021), -0.015}, normal, up, through + 0.021, 0.033,
                                       0.004),
        topology::make_rectangle_sheet({0.0013, 0, 0.0005 - 0.5 * depth}, normal, up, 0.042, depth + 0.001, 0.004),
        topology::make_rectangle_sheet({0.0087, 0, -0.0055}, normal, up, 0.042, 0.013, 0.004)};
    return std::make_shared<const topology::Incision>(sheets, scene.domain);
  };
  Problem problem = without_cut(scene);
  problem.incision = cut_to(0, 0.012);
  DiscretisationOptions options = appending();
  options.tip_functions = false;
  AppendedBody body(problem, options);
  for (const auto& [through, depth] : {std::pair(0.021, 0.012), std::pair(0.021, 0.0125), std::pair(0.021, 0.016)}) {
    problem.incision = cut_to(through, depth);
    REQUIRE(body.grow({}, problem).empty());
    const AppendedBody at_once(problem, options, body.uncut());
    CHECK(body.space().functions().size() == at_once.space().functions().size());
    const VectorX grown = body.nodal_displacements(body.solve()), fresh = at_once.nodal_displacements(at_once.solve());
    CHECK((grown - fresh).norm() < 1e-8 * fresh.norm());
  }
}

TEST_CASE("Where several fronts are near, a step is one number nowhere, and no function repeats another") {
  AppendingScene scene;
  scene.sprinkling.spacing = {.fine = 0.004, .coarse = 0.02, .slope = 0.5, .radius = 0.012, .centres = {{-0.01, 0, 0}}};
  Problem problem = without_cut(scene);
  DiscretisationOptions options = appending();
  options.tip_functions = false;
  std::shared_ptr<const UncutBody> known;
  std::mt19937 random(12);
  const auto in = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  for (int trial = 0; trial < 6; ++trial) {
    INFO("trial " << trial);
    // An upright cut that winds, as a blade leaves it that a hand turns, a short one beside it, and a scratch.
    const double waves = in(0.5, 2.5), phase = in(0, 2 * std::numbers::pi), high = in(0.004, 0.01),
                 depth = in(0.006, 0.014), length = in(0.02, 0.035);
    constexpr int columns = 40, rows = 6;
    topology::SurfaceMesh winding;
    for (int c = 0; c <= columns; ++c)
      for (int row = 0; row <= rows; ++row) {
        const double t = static_cast<double>(c) / columns;
        winding.vertices.emplace_back(-0.021 + length * t, high * std::sin(2 * std::numbers::pi * waves * t + phase),
                                      0.0005 - (depth + 0.0005) * row / rows);
      }
    for (int c = 0; c < columns; ++c)
      for (int row = 0; row < rows; ++row) {
        const int v = (rows + 1) * c + row;
        winding.triangles.push_back({v, v + rows + 1, v + 1});
        winding.triangles.push_back({v + 1, v + rows + 1, v + rows + 2});
      }
    const auto short_cut = [](double x, double y, double width, double below) {
      return topology::make_rectangle_sheet({x, y, 0.0005 - 0.5 * below}, Vector3::UnitX(), Vector3::UnitZ(), width,
                                            below + 0.001, 0.0005);
    };
    const std::vector<topology::SurfaceMesh> sheets{winding,
                                                    short_cut(in(0.002, 0.015), in(-0.015, 0.015), 0.003, 0.0065),
                                                    short_cut(in(-0.015, 0.0), in(-0.012, 0.012), 0.0015, 0.001)};
    problem.incision = std::make_shared<const topology::Incision>(sheets, problem.domain);
    const AppendedBody body = known == nullptr ? AppendedBody(problem, options) : AppendedBody(problem, options, known);
    known = body.uncut();
    const CutSpace& space = body.space();
    const FrontRuns runs(problem.incision);
    const auto is_long = [&](int run, int node) { return runs.length(run) >= problem.nodes.spacings[node]; };
    for (int k = 0; k < std::ssize(space.functions()); ++k) {
      const CutFunction& function = space.functions()[k];
      const int node = function.twin.node;
      if (function.twin.is_step && !is_long(function.twin.run, node))
        for (int run = 0; run < runs.count(); ++run)
          CHECK_FALSE((is_long(run, node) && runs.place(run, problem.nodes.positions[node], body.sphere_radius(node))));
      double strained = 0; // 1/m, the largest gradient
      for (const PartId part : function.twin.hidden)
        for (int n = 0; n < (function.twin.is_step ? std::ssize(space.samples(part)) : 1); ++n)
          if (ScalarTerm term; space.term_at(k, part, n, term))
            strained = std::max(strained, term.gradient.norm());
      CHECK(strained > 0);
    }
    CHECK(body.residual(body.solve(), {}, {}) < 1e-9);
  }
}

TEST_CASE("A copy of a body whose cut appends grows, or fails to, while the body stays as it was") {
  AppendingScene scene;
  const std::optional<Vector3> facing = GENERATE(std::optional<Vector3>{}, std::optional<Vector3>{{0, 0, 1}});
  Problem first = scene.problem();
  first.touched_from = facing;
  AppendedBody body(first, appending()), untroubled(first, appending(), body.uncut());
  const std::vector<int> top = nodes_on_top(scene.nodes, 12);
  const VectorX before = body.nodal_displacements(body.solve());
  const MatrixX compliance = body.contact_compliance(top);
  const int count = scene.nodes.size();
  const SprinkleIncrement change = scene.grow();
  Problem grown = scene.problem();
  grown.touched_from = facing;
  Problem failing = grown;
  failing.loads.body_force = [](const Vector3&) -> Vector3 { throw InputError("no force is known here"); };
  CHECK_THROWS_WITH(static_cast<void>(body.copy()->grow(change, failing)), Catch::Contains("no force is known"));
  const auto copy = body.copy();
  CHECK(copy->nodal_displacements(copy->solve()) == before); // all bits
  CHECK(copy->contact_compliance(top) == compliance);
  REQUIRE(copy->grow(change, grown).empty());
  REQUIRE(body.problem().nodes.size() == count);
  CHECK(body.nodal_displacements(body.solve()) == before);
  CHECK(body.contact_compliance(top) == compliance);
  CHECK(copy->nodal_displacements(copy->solve()).head(before.size()) != before);
  REQUIRE(untroubled.grow(change, grown).empty());
  CHECK(copy->nodal_displacements(copy->solve()) == untroubled.nodal_displacements(untroubled.solve()));
  CHECK(copy->contact_compliance(top) == untroubled.contact_compliance(top));
}

TEST_CASE("Forces on an appended cut's body act as they should") {
  AppendingScene scene;
  const auto body = discretise(scene.problem(), appending());
  std::vector<int> nodes = nodes_on_top(scene.nodes, 4);
  nodes.push_back(scene.first(NodeKind::lip));
  const std::vector<Field> responses = body->force_responses(nodes);
  const MatrixX compliance = body->contact_compliance(nodes);
  CHECK((compliance - compliance.transpose()).norm() < 1e-12 * compliance.norm());
  CHECK((compliance - body->contact_displacements(nodes, responses)).norm() < 1e-8 * compliance.norm());
  for (std::size_t c = 0; c < nodes.size(); ++c)
    for (int axis = 0; axis < 3; ++axis) {
      const Field& field = responses[3 * c + axis];
      CHECK(body->residual(field, {nodes[c]}, {Vector3::Unit(axis)}) < 1e-8);
      CHECK((total_of(body->constraint_forces(field)) + Vector3::Unit(axis)).norm() < 1e-6);
    }
  MatrixX cases = MatrixX::Zero(15, 2);
  cases.col(0).segment<3>(3) = Vector3(1, -2, 0.5);
  cases.col(1).segment<3>(12) = Vector3(0.3, 0.1, -1);
  const CaseResponses condensed = body->condense_cases(nodes, cases, nodes);
  CHECK((condensed.at - compliance * cases).norm() < 1e-10 * compliance.norm());
  CHECK((condensed.among - cases.transpose() * compliance * cases).norm() < 1e-10 * compliance.norm());
  // Work that the loads do is twice the energy of the field, and the field that a point's shape functions make is that
  // of at().
  const Field field = body->solve();
  const Vector3 x(0.002, 0.003, -0.004);
  ShapeFunctions shape;
  body->shape_at(x, shape);
  Vector3 displacement = Vector3::Zero();
  for (int k = 0; k < shape.size(); ++k)
    displacement += shape.value[k] * field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k]));
  for (const VectorTerm& term : shape.vectors)
    displacement += term.value * field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(term.group));
  CHECK((displacement - body->at(x, field).displacement).norm() < 1e-14);
  // Its gradient is the derivative.
  const PointState state = body->at(x, field);
  for (int axis = 0; axis < 3; ++axis) {
    const double h = 1e-7;
    const Vector3 slope = (body->at(x + h * Vector3::Unit(axis), field).displacement -
                           body->at(x - h * Vector3::Unit(axis), field).displacement) /
                          (2 * h);
    CHECK((slope - state.gradient.col(axis)).norm() < 1e-5 * state.gradient.norm());
  }
}

TEST_CASE("Pieces that an appended cut frees are refused, held or dropped") {
  experiments::CutBody body = appended_cube(250);
  experiments::hold_surface(
      body.problem, [](const Vector3& x, const Vector3& n) { return x.z() < 0 && n.z() < -0.5; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  CHECK_THROWS_AS(discretise(body.problem, appending()), InputError);

  // Loads in balance leave the springs alone: the free half stretches as it would anywhere.
  Loads balanced;
  balanced.initial_strain = Vector3(0.01, 0.02, -0.01).asDiagonal();
  body.problem.loads = balanced;
  const auto held = discretise(body.problem, appending(UnheldPieces::hold));
  const Field field = held->solve();
  CHECK(held->residual(field) < 1e-9);
  double stress = 0, largest = 0;
  for (int i = 0; i < body.problem.nodes.size(); ++i)
    if (const Vector3& x = body.problem.nodes.positions[i]; is_above_cut(x)) {
      const PointState state = held->at(x, field);
      stress = std::max(stress, state.stress.norm());
      largest = std::max(largest, (state.strain - balanced.initial_strain).norm());
    }
  CHECK(stress < 1e-8);
  CHECK(largest < 1e-8);

  body.problem.loads = {};
  body.problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -1); };
  const auto dropped = discretise(body.problem, appending(UnheldPieces::drop));
  const VectorX u = dropped->nodal_displacements(dropped->solve());
  double above = 0, below = 0;
  for (int i = 0; i < body.problem.nodes.size(); ++i) {
    double& most = is_above_cut(body.problem.nodes.positions[i]) ? above : below;
    most = std::max(most, u.segment<3>(3 * i).norm());
  }
  CHECK(below > 0.1);
  CHECK(above < 1e-9);
}

TEST_CASE("What an appended cut cannot have is refused") {
  AppendingScene scene;
  Problem problem = scene.problem();
  DiscretisationOptions options = appending();
  options.method = Method::collocation;
  CHECK_THROWS_AS(discretise(problem, options), InputError);
  // Nodes behind the lip nodes.
  problem.nodes.add(Vector3(0.01, 0.01, -0.02), 0.006, NodeKind::interior);
  CHECK_THROWS_AS(discretise(problem, appending()), InputError);
  // An exchange of nodes is not covered, and the body stays as it was.
  const auto body = discretise(scene.problem(), appending());
  const VectorX before = body->solve().coefficients;
  SprinkleIncrement change = scene.grow();
  change.removed.push_back(0);
  CHECK(dynamic_cast<AppendedBody&>(*body).grow(change, scene.problem()) == "nodes have been exchanged");
  CHECK(body->solve().coefficients == before);
}
