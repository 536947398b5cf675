// Functions that a cut appends to a body at finite strain: what they reproduce, what they part, and that what is there
// goes on.
#include "experiments/support/finite_block.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/finite/equilibrium.hpp"
#include "solvers/finite/rest_operator.hpp"
#include "solvers/finite/transfer.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;
using experiments::finite_block;
using experiments::FiniteBlock;

namespace {

/// A level cut from beyond the face x = -0.5 up to x = `end`, `above` m over the middle.
topology::SurfaceMesh level_cut(double end, double above, double tilt = 0) {
  const Vector3 normal = Vector3(std::sin(tilt), 0, std::cos(tilt)),
                along = Vector3(std::cos(tilt), 0, -std::sin(tilt));
  return topology::make_rectangle_sheet(0.5 * (end - 0.7) * along + above * normal, normal, along, 1.6, end + 0.7,
                                        0.08);
}

/// A cube of 1 m about the origin, its top and bottom held.
Problem cube_with(std::vector<topology::SurfaceMesh> cuts, double node_spacing = 0.17) {
  FiniteBlock block{.lower = Vector3::Constant(-0.5), .upper = Vector3::Constant(0.5), .seed = 1};
  for (const int face : {4, 5})
    block.held[face].fill(true);
  SpacingField spacing;
  spacing.fine = spacing.coarse = node_spacing;
  block.graded = spacing;
  block.lips_apart = true;
  block.cuts = std::move(cuts);
  return finite_block(block);
}

Problem cut_cube(double end, double above = 0.013, double tilt = 0) {
  return cube_with({level_cut(end, above, tilt)});
}

FiniteBody appended_body(Problem problem, const std::shared_ptr<const UncutFunctions>& uncut = nullptr) {
  return FiniteBody(std::move(problem), experiments::neo_hookean(1000, 0.45), {.sight = SightRule::appended}, nullptr,
                    uncut);
}

std::vector<Vector3> pulled_top(const FiniteBody& body, double by) {
  return body.prescribed_values([&](const Vector3& x) { return Vector3(0, 0, x.z() > 0.4999 ? by : 0); });
}

double opening(const FiniteBody& body, const VectorX& u, double x, double above) {
  const Vector3 off(0, 0, 1e-3), at(x, 0, above);
  return (body.at(at + off, u).displacement - body.at(at - off, u).displacement).z();
}

} // namespace

TEST_CASE("Functions on both sides of a cut and about its front reproduce linear fields") {
  const FiniteBody body = appended_body(cut_cube(0.1, 0.013, 0.2));
  const CutFunctions& functions = *body.cut_functions();
  int steps = 0;
  for (int k = 0; k < functions.appended(); ++k)
    steps += functions.twin(k).is_step ? 1 : 0;
  REQUIRE(steps > 5);
  REQUIRE(functions.appended() - steps > 10);
  REQUIRE(body.functions() == functions.uncut()->size() + functions.appended());
  const Matrix3 gradient = (Matrix3() << 0.3, 0.2, -0.1, 0.05, -0.2, 0.1, 0.4, 0, 0.1).finished();
  VectorX u(3 * body.functions());
  for (int f = 0; f < body.functions(); ++f)
    u.segment<3>(3 * f) = gradient * body.problem().nodes.positions[body.node_of(f)];
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> anywhere(-0.499, 0.499);
  for (int k = 0; k < 500; ++k) {
    const Vector3 x(anywhere(random), anywhere(random), 0.3 * anywhere(random));
    const FiniteState state = body.at(x, u);
    CHECK((state.displacement - gradient * x).norm() < 1e-12);
    CHECK((state.deformation - Matrix3::Identity() - gradient).norm() < 1e-10);
  }
  // At the points of the quadrature, too: a turn is without stress.
  const Matrix3 turn = Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  for (int f = 0; f < body.functions(); ++f)
    u.segment<3>(3 * f) = (turn - Matrix3::Identity()) * body.problem().nodes.positions[body.node_of(f)];
  FiniteForces forces;
  body.evaluate(u, forces);
  CHECK(forces.energy < 1e-10);
  CHECK(forces.forces.norm() < 1e-10);
}

TEST_CASE("Fields are smooth wherever nothing is cut, with fronts beside and across one another, too") {
  const topology::SurfaceMesh lower = level_cut(0, -0.15), upper = level_cut(0, 0.15);
  topology::SurfaceMesh turned =
      topology::make_rectangle_sheet({-0.35, 0, 0.15}, -Vector3::UnitZ(), Vector3::UnitX(), 1.6, 0.7, 0.08);
  topology::SurfaceMesh from_there =
      topology::make_rectangle_sheet({0.45, 0, 0.01}, -Vector3::UnitZ(), Vector3::UnitX(), 1.6, 0.7, 0.08);
  topology::SurfaceMesh across =
      topology::make_rectangle_sheet({-0.2, 0.011, 0.2}, Vector3::UnitY(), Vector3::UnitZ(), 0.7, 0.9, 0.08);
  const std::vector<std::vector<topology::SurfaceMesh>> scenes = {
      {lower, upper}, {lower, turned}, {level_cut(-0.1, 0.01), from_there}, {level_cut(0.1, 0.013), across}};
  for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
    const FiniteBody body = appended_body(cube_with(scenes[scene]));
    const topology::Incision& cut = *body.problem().incision;
    std::srand(static_cast<unsigned>(scene) + 1);
    const VectorX u = VectorX::Random(3 * body.functions());
    std::mt19937_64 random(scene + 1);
    std::uniform_real_distribution<double> anywhere(-0.49, 0.49);
    double worst = 0;
    Vector3 at = Vector3::Zero();
    for (int k = 0; k < 4000; ++k) {
      const Vector3 x(anywhere(random), anywhere(random), 0.7 * anywhere(random));
      Vector3 y = x + 0.02 * Vector3(anywhere(random), anywhere(random), anywhere(random));
      if (cut.closest(x, 0.03) || cut.blocks(x, y))
        continue;
      // Twenty small steps: a jump is in one of them.
      for (int step = 0; step < 20; ++step) {
        const Vector3 a = x + step * (y - x) / 20, b = x + (step + 1) * (y - x) / 20;
        const double change = (body.at(b, u).displacement - body.at(a, u).displacement).norm();
        if (change > worst) {
          worst = change;
          at = a;
        }
      }
    }
    INFO("scene " << scene << ": " << worst << " at " << at.transpose());
    CHECK(worst < 0.06); // steps of up to 0.8 mm, coefficients of up to 1
  }
}

TEST_CASE("A second cut across the first, or one beside it, opens a loaded body as both at once do") {
  const topology::SurfaceMesh first = level_cut(0.1, 0.013);
  const topology::SurfaceMesh across =
      topology::make_rectangle_sheet({-0.2, 0.011, 0.2}, Vector3::UnitY(), Vector3::UnitZ(), 0.7, 0.9, 0.08);
  const topology::SurfaceMesh beside = level_cut(0.1, 0.26);
  for (const topology::SurfaceMesh& second : {across, beside}) {
    const FiniteBody one = appended_body(cube_with({first}));
    EquilibriumOptions accurate;
    accurate.tolerance = 1e-6;
    Equilibrium before(one, accurate);
    before.solve({pulled_top(one, 0.25)});
    Problem both = cube_with({first, second});
    both.domain = one.problem().domain;
    const FiniteBody two = appended_body(both, one.cut_functions()->uncut());
    std::vector<char> is_new;
    VectorX start = two.cut_functions()->state_from(*one.cut_functions(), before.coefficients(), is_new);
    start = nearest_state(two, start, is_new,
                          [&](const Vector3& x) { return one.at(x, before.coefficients()).deformation; });
    FiniteForces forces;
    two.evaluate(start, forces);
    CHECK(forces.least_jacobian > 0.05);
    Equilibrium grown(two, accurate), at_once(two, accurate);
    grown.set_coefficients(start);
    const EquilibriumStatus after = grown.solve({pulled_top(two, 0.25)});
    const EquilibriumStatus wanted = at_once.solve({pulled_top(two, 0.25)});
    CHECK(after.energy == Approx(wanted.energy).epsilon(1e-4));
    CHECK(opening(two, grown.coefficients(), -0.3, 0.013) > 0.03);
  }
}

TEST_CASE("What a cut parts does not know of the other side; forces are the slope of the energy") {
  const FiniteBody body = appended_body(cut_cube(0.7));
  const CutFunctions& functions = *body.cut_functions();
  // The side that a function moves: that of the points where it has a gradient.
  const PointTable& table = body.points();
  std::vector<int> side(body.functions(), 0);
  for (int group = 0; group < table.groups(); ++group)
    for (int slot = table.start[group]; slot < table.start[group + 1]; ++slot)
      for (int lane = 0; lane < table.count[group]; ++lane)
        if (!table.gradient(slot, lane).isZero(0)) {
          const double z = table.positions[static_cast<std::size_t>(point_lanes) * group + lane].z() - 0.013;
          side[table.nodes[slot]] |= z > 0 ? 1 : 2;
        }
  CHECK(std::count(side.begin(), side.end(), 3) == 0);
  CHECK(std::count(side.begin(), side.end(), 0) == 0);
  REQUIRE(functions.appended() > 20);
  std::srand(5);
  const VectorX u = 0.01 * VectorX::Random(3 * body.functions()), d = VectorX::Random(u.size());
  FiniteForces at, plus, minus;
  body.evaluate(u, at);
  body.evaluate(u + 1e-6 * d, plus);
  body.evaluate(u - 1e-6 * d, minus);
  CHECK((plus.energy - minus.energy) / 2e-6 == Approx(at.forces.dot(d)).epsilon(1e-6));
  // Moving all of the upper side does nothing to the forces on the lower one.
  VectorX moved = u;
  for (int f = 0; f < body.functions(); ++f)
    if (side[f] == 1)
      moved.segment<3>(3 * f) += 0.1 * d.segment<3>(3 * f) * 0.1;
  FiniteForces after;
  body.evaluate(moved, after);
  double change = 0;
  for (int f = 0; f < body.functions(); ++f)
    if (side[f] == 2)
      change = std::max(change, (after.forces - at.forces).segment<3>(3 * f).norm());
  CHECK(change <= 1e-14 * at.forces.norm());
}

TEST_CASE("A cut opens alike wherever the background boxes lie, and a pull on it says what the uncut body is") {
  // Boxes of a cube of 1 m meet in the plane of its middle.
  double openings[2];
  for (const int k : {0, 1}) {
    const double above = k == 0 ? 0 : 2e-4;
    const FiniteBody body = appended_body(cut_cube(0.1, above));
    Equilibrium equilibrium(body);
    const EquilibriumStatus status = equilibrium.solve({pulled_top(body, 0.2)});
    CHECK(status.converged);
    openings[k] = opening(body, equilibrium.coefficients(), -0.3, above);
  }
  CHECK(openings[0] > 0.08);
  CHECK(openings[0] == Approx(openings[1]).epsilon(0.01));
}

TEST_CASE("A body under load goes on as it was when its cut grows, and comes to where one cut at once comes to") {
  const FiniteBody first = appended_body(cut_cube(-0.2));
  const std::shared_ptr<const UncutFunctions> uncut = first.cut_functions()->uncut();
  EquilibriumOptions accurate;
  accurate.tolerance = 1e-7;
  Equilibrium before(first, accurate);
  before.solve({pulled_top(first, 0.25)});
  VectorX state = before.coefficients();
  std::unique_ptr<FiniteBody> last;
  for (const double end : {-0.1, 0.0, 0.1}) {
    Problem longer = cut_cube(end);
    longer.domain = first.problem().domain;
    auto next = std::make_unique<FiniteBody>(longer, experiments::neo_hookean(1000, 0.45),
                                             FiniteOptions{.sight = SightRule::appended}, nullptr, uncut);
    REQUIRE(next->cut_functions()->uncut() == uncut);
    const FiniteBody& old = last != nullptr ? *last : first;
    std::vector<char> is_new;
    const VectorX start = next->cut_functions()->state_from(*old.cut_functions(), state, is_new);
    CHECK(std::count(is_new.begin(), is_new.end(), 1) > 0);
    CHECK(std::count(is_new.begin(), is_new.begin() + uncut->size(), 1) == 0);
    // Away from the old and the new front nothing has moved.
    for (const Vector3& x : {Vector3(-0.45, 0.1, 0.2), Vector3(-0.45, 0.1, -0.2), Vector3(0.4, -0.3, 0.3)})
      CHECK((next->at(x, start).displacement - old.at(x, state).displacement).norm() < 2e-3);
    Equilibrium equilibrium(*next, accurate);
    equilibrium.set_coefficients(start);
    equilibrium.solve({pulled_top(*next, 0.25)});
    state = equilibrium.coefficients();
    last = std::move(next);
  }
  const FiniteBody at_once = appended_body(cut_cube(0.1));
  Equilibrium equilibrium(at_once, accurate);
  equilibrium.solve({pulled_top(at_once, 0.25)});
  REQUIRE(at_once.functions() == last->functions());
  const double wide = opening(at_once, equilibrium.coefficients(), -0.3, 0.013);
  CHECK(wide > 0.1);
  CHECK(opening(*last, state, -0.3, 0.013) == Approx(wide).epsilon(1e-5));
}

TEST_CASE("A share of the held surface that a cut parts is held on both sides") {
  Problem problem = cut_cube(0.7);
  const HeldRegion below_and_above = problem.prescribed_region;
  // The side x = 0.5, which the cut parts, in place of top and bottom.
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != NodeKind::lip && problem.nodes.positions[i].x() > 0.4999)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_region = [](const Vector3&, const Vector3& normal) { return normal.x() > 0.9; };
  problem.loads.body_force = [](const Vector3& x) { return Vector3(0, 0, x.z() > 0.013 ? 200 : -200); };
  const FiniteBody body = appended_body(problem);
  Equilibrium equilibrium(body);
  CHECK(equilibrium.solve({}).converged);
  const VectorX& u = equilibrium.coefficients();
  CHECK(opening(body, u, -0.45, 0.013) > 0.05);
  CHECK(body.held().entries().size() > body.problem().prescribed.size());
  double slip = 0;
  for (double y = -0.45; y < 0.5; y += 0.1)
    for (double z = -0.45; z < 0.5; z += 0.1)
      slip = std::max(slip, body.at({0.5, y, z}, u).displacement.norm());
  CHECK(slip < 0.02 * opening(body, u, -0.45, 0.013));
  // Weight is borne: the reactions are the forces.
  Vector3 sum = Vector3::Zero();
  for (const Vector3& reaction : equilibrium.constraint_forces())
    sum += reaction;
  double up = 0, down = 0;
  for (const Vector3& reaction : equilibrium.constraint_forces())
    (reaction.z() > 0 ? up : down) += reaction.z();
  CHECK(sum.z() == Approx(200 * 0.013 * 2).epsilon(0.05));
  CHECK(down < -80);
  CHECK(up > 80);
}

TEST_CASE("The bordered factor of the uncut body is the tangent at rest of the cut one") {
  const topology::SurfaceMesh across =
      topology::make_rectangle_sheet({-0.3, 0.011, 0.1}, Vector3::UnitY(), Vector3::UnitZ(), 0.4, 0.4, 0.08);
  // A body in tension, its side x = 0.5 held, which the last of the cuts parts; the cuts follow one another as one that
  // grows, but for that across.
  const auto problem_with = [&](std::vector<topology::SurfaceMesh> cuts) {
    Problem problem = cube_with(std::move(cuts), 0.13);
    problem.prescribed.clear();
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (problem.nodes.kinds[i] != NodeKind::lip && problem.nodes.positions[i].x() > 0.4999)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    problem.prescribed_region = [](const Vector3&, const Vector3& normal) { return normal.x() > 0.9; };
    problem.loads.initial_strain(2, 2) = -0.1;
    return problem;
  };
  const std::vector<std::vector<topology::SurfaceMesh>> scenes = {
      {level_cut(-0.1, 0.013)}, {level_cut(0.0, 0.013)}, {level_cut(-0.1, 0.013), across}, {level_cut(0.7, 0.013)}};
  for (const double poisson_ratio : {0.3, 0.49}) {
    const std::shared_ptr<const Law> law = experiments::neo_hookean(1000, poisson_ratio);
    const FiniteOptions options{.sight = SightRule::appended};
    Problem uncut_problem = problem_with({level_cut(-0.1, 0.013)});
    uncut_problem.incision = nullptr;
    const FiniteBody uncut(uncut_problem, law, options);
    REQUIRE(uncut.cut_functions()->appended() == 0);
    const RestOperator whole(uncut);
    REQUIRE(whole.bordered() == nullptr);
    CutLineage lineage = whole.lineage();
    REQUIRE(lineage.tangent != nullptr);
    for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
      Problem problem = problem_with(scenes[scene]);
      problem.domain = uncut.problem().domain;
      const FiniteBody body(problem, law, options, nullptr, uncut.cut_functions()->uncut());
      REQUIRE(body.cut_functions()->uncut() == uncut.cut_functions()->uncut());
      const CutFunctions& functions = *body.cut_functions();
      bool has_guest = false;
      for (int k = 0; k < functions.appended(); ++k)
        has_guest = has_guest || functions.host_of(k) >= functions.uncut()->size();
      REQUIRE((scene != 2 || has_guest));
      REQUIRE((scene != 3 || body.held().entries().size() > problem.prescribed.size()));
      const auto largest = [](const FiniteBody& of) {
        return *std::max_element(of.blocks().volume.begin(), of.blocks().volume.end());
      };
      if (scene == 3 && poisson_ratio > 0.4) // what lies between the cut and the boxes joins other blocks
        REQUIRE(largest(body) > 1.01 * largest(uncut));
      const RestOperator bordered(body, lineage);
      REQUIRE(bordered.bordered() != nullptr);
      lineage = bordered.lineage();
      CHECK((scene != 1 || bordered.bordered()->kept() > 10));
      SparseMatrix lower;
      body.tangent(body.stress_free(), RestOperator::penalty, lower);
      std::srand(static_cast<unsigned>(scene) + 1);
      const VectorX wanted = VectorX::Random(lower.rows());
      const auto reordered = [&](const VectorX& v, bool back) {
        VectorX result(v.size());
        for (Eigen::Index f = 0; f < body.functions(); ++f) {
          const Eigen::Index at = 3 * static_cast<Eigen::Index>(body.rank()[f]);
          if (back)
            result.segment<3>(3 * f) = v.segment<3>(at);
          else
            result.segment<3>(at) = v.segment<3>(3 * f);
        }
        return result;
      };
      const VectorX forces = reordered(lower.selfadjointView<Eigen::Lower>() * reordered(wanted, false), true);
      VectorX found;
      bordered.solve(forces, found);
      const VectorX off = found - wanted,
                    left = reordered(lower.selfadjointView<Eigen::Lower>() * reordered(off, false), true);
      INFO("nu " << poisson_ratio << ", scene " << scene);
      CHECK(off.dot(left) < 1e-11 * wanted.dot(forces)); // energy of the error: the support's
      VectorX again;                                     // without what was kept
      RestOperator(body, whole.lineage()).solve(forces, again);
      CHECK((found - again).norm() < 1e-9 * found.norm());
    }
    // Another material or pre-strain has another factor.
    Problem problem = problem_with(scenes[0]);
    problem.domain = uncut.problem().domain;
    const FiniteBody softer(problem, experiments::neo_hookean(999, poisson_ratio), options, nullptr, lineage.uncut);
    CHECK(RestOperator(softer, lineage).bordered() == nullptr);
    problem.loads.initial_strain(2, 2) = -0.11;
    const FiniteBody stretched(problem, law, options, nullptr, lineage.uncut);
    CHECK(RestOperator(stretched, lineage).bordered() == nullptr);
  }
}
