// Bodies at finite strain: derivatives by differences, rotations, the patch test, equilibria by two methods, contact,
// words for what has no equilibrium, bits against threads.
#include "experiments/analytic/finite_strain.hpp"
#include "experiments/support/finite_block.hpp"
#include "solvers/algebra/parallel.hpp"
#include "tests/support/cut_block.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using experiments::face_force;
using experiments::finite_block;
using experiments::FiniteBlock;

namespace {

FiniteBlock held_block(int divisions, std::initializer_list<int> faces) {
  FiniteBlock block{.spacing = 1.0 / divisions};
  for (const int face : faces)
    block.held[face].fill(true);
  return block;
}

/// A stretched, sheared and disturbed state.
VectorX disturbed(const FiniteBody& body) {
  std::srand(7);
  VectorX u = 0.02 * VectorX::Random(3 * body.size());
  for (int i = 0; i < body.size(); ++i) {
    const Vector3& x = body.problem().nodes.positions[i];
    u.segment<3>(3 * i) += Vector3(0.3 * x.x() + 0.2 * x.y(), -0.1 * x.y(), 0.1 * x.x());
  }
  return u;
}

VectorX by_rank(const FiniteBody& body, const VectorX& v) {
  VectorX ordered(v.size());
  for (int i = 0; i < body.size(); ++i)
    ordered.segment<3>(3 * body.rank()[i]) = v.segment<3>(3 * i);
  return ordered;
}

/// Energy, forces and tangent at u against central differences along a random direction.
void check_derivatives(const FiniteBody& body, const VectorX& u) {
  const VectorX d = VectorX::Random(u.size());
  constexpr double small = 1e-6;
  FiniteForces at, plus, minus;
  body.evaluate(u, at);
  body.evaluate(u + small * d, plus);
  body.evaluate(u - small * d, minus);
  CHECK((plus.energy - minus.energy) / (2 * small) == Approx(at.forces.dot(d)).epsilon(1e-6));
  SparseMatrix lower;
  body.tangent(u, 0, lower);
  const VectorX product = lower.selfadjointView<Eigen::Lower>() * by_rank(body, d);
  const VectorX difference = by_rank(body, (plus.forces - minus.forces) / (2 * small));
  CHECK((product - difference).norm() < 1e-7 * difference.norm());
}

std::vector<Vector3> pressed_top(const FiniteBody& body, double depth) {
  return body.prescribed_values([&](const Vector3& x) { return Vector3(0, 0, x.z() > 1 - 1e-9 ? -depth : 0); });
}

/// A block cut in two whose whole surface is held.
Problem cut_through_and_held_all_around() {
  const tests::CutBlock block = tests::cut_block(6, true, 2);
  Problem problem = tests::problem_of(block, {1, 0.45, 0});
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != NodeKind::lip && problem.nodes.positions[i].cwiseAbs().maxCoeff() > 0.5 - 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.cwiseAbs().maxCoeff() > 0.5 - 1e-9; };
  return problem;
}

} // namespace

TEST_CASE("Forces are the slope of the energy, the tangent that of the forces") {
  for (const double nu : {0.3, 0.49}) {
    const FiniteBody body(finite_block(held_block(3, {4})), experiments::neo_hookean(2, nu));
    CHECK((nu > 0.4) == (body.blocks().size() > 0));
    check_derivatives(body, disturbed(body));
  }
}

TEST_CASE("A rotation by 90 degrees bears no forces") {
  const FiniteBody body(finite_block(held_block(3, {4})), experiments::neo_hookean(2, 0.49));
  const Matrix3 turn =
      Eigen::AngleAxisd(std::numbers::pi / 2, Vector3(1, 2, 3).normalized()).toRotationMatrix() - Matrix3::Identity();
  VectorX u(3 * body.size());
  for (int i = 0; i < body.size(); ++i)
    u.segment<3>(3 * i) = turn * body.problem().nodes.positions[i];
  FiniteForces rotation, reference;
  body.evaluate(u, rotation);
  body.evaluate(disturbed(body), reference);
  CHECK(rotation.forces.norm() < 1e-10 * reference.forces.norm());
  CHECK(rotation.least_jacobian == Approx(1).epsilon(1e-12));
}

TEST_CASE("Forces and energy have the same bits with any number of threads") {
  const FiniteBody body(finite_block(held_block(6, {4})), experiments::neo_hookean(2, 0.49));
  const VectorX u = disturbed(body);
  FiniteForces one, four;
  body.evaluate(u, one);
  set_thread_count(4);
  body.evaluate(u, four);
  set_thread_count(1);
  CHECK(one.energy == four.energy);
  CHECK(one.forces == four.forces);
  CHECK(one.least_jacobian == four.least_jacobian);
}

TEST_CASE("Gradients that fit the quadrature reproduce linear functions and surface integrals") {
  const FiniteBody body(finite_block(held_block(4, {4})), experiments::neo_hookean(1, 0.3));
  CHECK(body.consistency().before > 1e-3);
  CHECK(body.consistency().after < 2e-7);
  CHECK(body.consistency().change < 0.02);
  const PointTable& points = body.points();
  for (int group = 0; group < points.groups(); ++group)
    for (int lane = 0; lane < points.count[group]; ++lane) {
      Vector3 sum = Vector3::Zero();
      Matrix3 moment = Matrix3::Zero();
      for (int slot = points.start[group]; slot < points.start[group + 1]; ++slot) {
        sum += points.gradient(slot, lane);
        moment += body.problem().nodes.positions[points.nodes[slot]] * points.gradient(slot, lane).transpose();
      }
      REQUIRE(sum.norm() < 1e-10);
      REQUIRE((moment - Matrix3::Identity()).norm() < 1e-10);
    }
}

TEST_CASE("Quasi-Newton and Newton find the same compressed block, and forces balance") {
  const FiniteBody body(finite_block(held_block(4, {4, 5})), experiments::neo_hookean(1, 0.49));
  EquilibriumOptions options;
  options.tolerance = 1e-7;
  Equilibrium quasi(body, options);
  options.method = FiniteMethod::newton;
  Equilibrium newton(body, options);
  for (const double depth : {0.1, 0.2, 0.3}) {
    const EquilibriumStatus a = quasi.solve({pressed_top(body, depth), 1, {}});
    const EquilibriumStatus b = newton.solve({pressed_top(body, depth), 1, {}});
    CHECK(a.converged);
    CHECK(a.factorisations == 0);
    CHECK(b.iterations < a.iterations);
    CHECK(a.energy == Approx(b.energy).epsilon(1e-9));
    CHECK(a.least_jacobian > 0.3);
  }
  CHECK((quasi.coefficients() - newton.coefficients()).norm() < 1e-5 * newton.coefficients().norm());
  const Vector3 top = face_force(body, quasi.constraint_forces(), 2, 1),
                base = face_force(body, quasi.constraint_forces(), 2, 0);
  CHECK(top.z() < -0.3);
  CHECK((top + base).norm() < 1e-5 * top.norm());
}

TEST_CASE("A confined block and one that stretches freely follow the closed forms to twice the length") {
  for (const bool confined : {true, false}) {
    FiniteBlock block{.spacing = 1.0 / 3};
    for (int axis = 0; axis < 3; ++axis) {
      block.held[2 * axis][axis] = true;
      block.held[2 * axis + 1][axis] = confined || axis == 2;
    }
    const auto law = experiments::neo_hookean(1, 0.45);
    const FiniteBody body(finite_block(block), law);
    EquilibriumOptions options;
    options.tolerance = 1e-6;
    Equilibrium equilibrium(body, options);
    for (const double stretch : {1.25, 1.5, 1.75, 2.0})
      equilibrium.solve(
          {body.prescribed_values([&](const Vector3& x) { return Vector3(0, 0, (stretch - 1) * x.z()); }), 1, {}});
    const auto exact = experiments::block_state(*law, {1, 1, 2}, {confined, confined, true});
    CHECK(face_force(body, equilibrium.constraint_forces(), 2, 1).z() == Approx(exact.stress.z()).epsilon(1e-4));
    const FiniteState middle = body.at({0.5, 0.5, 0.5}, equilibrium.coefficients());
    CHECK(middle.deformation(0, 0) == Approx(exact.stretch.x()).epsilon(1e-4));
    CHECK(middle.first_piola(2, 2) == Approx(exact.stress.z()).epsilon(1e-3));
  }
}

TEST_CASE("A ball pressed into a block bears what the base bears and stays outside") {
  Problem problem = finite_block(held_block(6, {4}));
  problem.touched_from = Vector3::UnitZ();
  std::vector<int> candidates;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (x.z() > 1 - 1e-9 && (x - Vector3(0.5, 0.5, 1)).norm() < 0.5)
      candidates.push_back(i);
  }
  const FiniteBody body(std::move(problem), experiments::neo_hookean(1, 0.45));
  Equilibrium equilibrium(body);
  const topology::SphereTip ball{0.4};
  equilibrium.set_contact(ball, candidates);
  double before = 0;
  for (const double depth : {0.05, 0.1, 0.15, 0.2}) {
    FiniteLoading loading;
    loading.tool = topology::ToolPose{{0.5, 0.5, 1 - depth}, Vector3::UnitZ()};
    const EquilibriumStatus status = equilibrium.solve(loading);
    CHECK(status.tool_force.z() > before);
    before = status.tool_force.z();
    CHECK(status.penetration < 1e-3);
    CHECK(status.touching > 0);
    const Vector3 base = face_force(body, equilibrium.constraint_forces(), 2, 0);
    CHECK((base - status.tool_force).norm() < 0.01 * status.tool_force.norm());
    CHECK(std::abs(status.tool_force.x()) < 0.1 * before);
    // Without friction the ball has no torque about its centre.
    const Vector3 arm = ball.radius * loading.tool->axis;
    CHECK((status.tool_torque - arm.cross(status.tool_force)).norm() < 1e-6 * ball.radius * before);
  }
  FiniteLoading away;
  away.tool = topology::ToolPose{{0.5, 0.5, 1.2}, Vector3::UnitZ()};
  const EquilibriumStatus released = equilibrium.solve(away);
  CHECK(released.touching == 0);
  CHECK(equilibrium.coefficients().lpNorm<Eigen::Infinity>() < 0.01);
}

TEST_CASE("A block cut through comes apart without force, one cut in part opens and balances") {
  for (const bool through : {true, false}) {
    const tests::CutBlock block = tests::cut_block(6, through, 2);
    Problem problem = tests::problem_of(block, {1, 0.45, 0});
    problem.prescribed.clear();
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (problem.nodes.kinds[i] != NodeKind::lip && std::abs(problem.nodes.positions[i].z()) > 0.5 - 1e-9)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    problem.prescribed_region = [](const Vector3& x, const Vector3& normal) {
      return std::abs(normal.z()) > 0.5 && std::abs(x.z()) > 0.5 - 1e-9;
    };
    const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
    CHECK(body.consistency().after < 0.1 * body.consistency().before);
    Equilibrium equilibrium(body);
    EquilibriumStatus status;
    for (const double pull : {0.1, 0.2, 0.3})
      status = equilibrium.solve(
          {body.prescribed_values([&](const Vector3& x) { return Vector3(0, 0, x.z() > 0 ? pull : 0); }), 1, {}});
    const Vector3 top = face_force(body, equilibrium.constraint_forces(), 2, 0.5),
                  base = face_force(body, equilibrium.constraint_forces(), 2, -0.5);
    if (through) {
      CHECK(top.norm() < 1e-6);
      CHECK(status.least_jacobian == Approx(1).epsilon(1e-3));
    } else {
      CHECK(top.z() > 0.2);
      CHECK((top + base).norm() < 1e-3 * top.norm());
    }
  }
}

TEST_CASE("A block that is strained as it is given goes back to its stress-free shape when it may") {
  FiniteBlock block{.spacing = 0.25};
  for (int axis = 0; axis < 3; ++axis)
    block.held[2 * axis][axis] = true; // rollers on three faces
  for (const double nu : {0.3, 0.49}) {
    Problem problem = finite_block(block);
    const Vector3 elastic(1.25, 0.9, 0.95);
    problem.loads.initial_strain = Matrix3::Identity() - Matrix3(elastic.asDiagonal());
    const FiniteBody body(std::move(problem), experiments::neo_hookean(1, nu));
    EquilibriumOptions options;
    options.tolerance = 1e-8; // of the forces at the start
    Equilibrium equilibrium(body, options);
    const EquilibriumStatus status = equilibrium.solve({});
    CHECK(status.energy < 1e-8);
    const double error = experiments::nodal_error(
        body, equilibrium.coefficients(), [&](const Vector3& x) { return Vector3(x.cwiseQuotient(elastic) - x); });
    CHECK(error < 1e-4);
    for (const Vector3& reaction : equilibrium.constraint_forces())
      CHECK(reaction.norm() < 1e-5);
  }
}

TEST_CASE("A confined viscoelastic block relaxes as its Prony series, and forgets a state of long ago") {
  FiniteBlock block = held_block(3, {4, 5});
  for (int face = 0; face < 4; ++face)
    block.held[face][face / 2] = true; // no way to the sides
  for (int face = 4; face < 6; ++face)
    block.held[face] = {false, false, true};
  const std::vector<PronyTerm> prony{{0.4, 0.5}, {0.3, 5}};
  for (const double nu : {0.3, 0.49}) {
    const auto law = experiments::neo_hookean(1, nu);
    FiniteBody body(finite_block(block), law, {.prony = prony});
    EquilibriumOptions options;
    options.tolerance = 1e-9;
    Equilibrium equilibrium(body, options);
    Matrix3 f = Matrix3::Identity();
    f(2, 2) = 0.8;
    double energy = 0;
    Matrix3 all, shape;
    law->evaluate({&f, 1}, {}, {&energy, 1}, {&all, 1});
    law->evaluate_isochoric({&f, 1}, {}, {&energy, 1}, {&shape, 1});
    const auto force = [&](double lasting) { return (all - shape + lasting * shape)(2, 2); };
    double time = 0;
    for (const double step : {0.0, 0.1, 0.4, 0.4, 3.0, 20.0}) {
      time += step;
      body.begin_step(step);
      equilibrium.solve({pressed_top(body, 0.2), 1, {}});
      body.accept_step(equilibrium.coefficients());
      const double left = 0.3 + 0.4 * std::exp(-time / 0.5) + 0.3 * std::exp(-time / 5);
      const Vector3 top = face_force(body, equilibrium.constraint_forces(), 2, 1);
      CHECK(top.z() == Approx(force(left)).epsilon(1e-4));
      CHECK(body.at({0.4, 0.5, 0.6}, equilibrium.coefficients()).first_piola(2, 2) ==
            Approx(force(left)).epsilon(1e-3));
    }
    body.begin_step(FiniteBody::for_ever);
    equilibrium.solve({pressed_top(body, 0.2), 1, {}});
    CHECK(face_force(body, equilibrium.constraint_forces(), 2, 1).z() == Approx(force(0.3)).epsilon(1e-6));
    CHECK_THROWS_AS(body.begin_step(-1), InputError);
  }
  CHECK_THROWS_AS(FiniteBody(finite_block(block), experiments::neo_hookean(1, 0.3), {.prony = {{1.2, 1}}}), InputError);
}

TEST_CASE("The tangent of a step of a viscoelastic body is that of its forces") {
  FiniteBody body(finite_block(held_block(3, {4})), experiments::neo_hookean(2, 0.49), {.prony = {{0.5, 1}}});
  const VectorX u = disturbed(body);
  body.accept_step(0.5 * u);
  body.begin_step(0.7);
  check_derivatives(body, u);
}

TEST_CASE("A cut that is pressed together bears what the uncut block does, and opens when it is drawn") {
  const Problem problem = cut_through_and_held_all_around();
  const auto law = experiments::neo_hookean(1, 0.45);
  const FiniteBody body(problem, law);
  const std::vector<LipPair> pairs = lip_pairs(problem.nodes);
  REQUIRE(pairs.size() > 10);
  const auto squeezed = [&](double by) { return body.prescribed_values([by](const Vector3& x) { return by * x; }); };
  double error[2];
  for (const bool touch : {false, true}) {
    Equilibrium equilibrium(body);
    if (touch)
      equilibrium.set_lips(pairs);
    EquilibriumStatus status;
    for (const double by : {-0.02, -0.04}) // all around: a hydrostatic pressure, the same on every plane
      status = equilibrium.solve({squeezed(by), 1, {}});
    error[touch ? 1 : 0] =
        experiments::nodal_error(body, equilibrium.coefficients(), [](const Vector3& x) { return Vector3(-0.04 * x); });
    if (!touch)
      continue;
    CHECK(status.closed == std::ssize(pairs));
    CHECK(status.penetration < 1e-3);
    double energy = 0;
    Matrix3 stress;
    const Matrix3 f = 0.96 * Matrix3::Identity();
    law->evaluate({&f, 1}, {}, {&energy, 1}, {&stress, 1});
    CHECK(status.energy == Approx(energy).epsilon(0.01));
    // Drawn apart the lips do not hold each other.
    for (const double by : {-0.02, 0.0, 0.005, 0.01})
      status = equilibrium.solve({squeezed(by), 1, {}});
    CHECK(status.closed == 0);
    for (const double opening : equilibrium.lips()->contact().gaps(equilibrium.coefficients()))
      CHECK(opening > 0);
  }
  CHECK(error[1] < 0.02);
  CHECK(error[0] > 0.05);
}

TEST_CASE("Lips that turn while they are pressed together do not overlap, and bear what the uncut block does") {
  const Problem problem = cut_through_and_held_all_around();
  const auto law = experiments::neo_hookean(1, 0.45);
  const FiniteBody body(problem, law);
  const std::vector<LipPair> pairs = lip_pairs(problem.nodes);
  const Matrix3 squeeze = 0.99 * Matrix3::Identity();
  double energy = 0;
  Matrix3 stress;
  law->evaluate({&squeeze, 1}, {}, {&energy, 1}, {&stress, 1});
  // Along the normals of the present state, in spacings.
  const auto farthest = [&](const VectorX& coefficients) {
    FiniteLips now(body, pairs);
    now.turn(body.piola_maps(coefficients));
    const std::vector<double> openings = now.contact().gaps(coefficients);
    double most = 0;
    for (std::size_t p = 0; p < pairs.size(); ++p)
      most = std::max(most, std::abs(openings[p]) / problem.nodes.spacings[pairs[p].plus]);
    return most;
  };
  EquilibriumOptions options;
  for (const FiniteMethod method : {FiniteMethod::quasi_newton, FiniteMethod::newton}) {
    options.method = method;
    Equilibrium equilibrium(body, options);
    equilibrium.set_lips(pairs);
    for (const double degrees : {0.0, 10.0, 30.0, 60.0}) {
      INFO(to_string(method) << ", " << degrees << " degrees");
      const Matrix3 turn = Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3::UnitX()).matrix();
      const auto exact = [&](const Vector3& x) { return Vector3(turn * squeeze * x - x); };
      const EquilibriumStatus status = equilibrium.solve({body.prescribed_values(exact), 1, {}});
      CHECK(farthest(equilibrium.coefficients()) < options.penetration);
      CHECK(status.penetration < options.penetration);
      CHECK(status.residual < options.tolerance);
      CHECK(status.closed == std::ssize(pairs));
      CHECK(status.energy == Approx(energy).epsilon(0.01));
      const Vector3 top = face_force(body, equilibrium.constraint_forces(), 2, 0.5);
      CHECK((top - stress(2, 2) * turn.col(2)).norm() < 0.01 * std::abs(stress(2, 2)));
      CHECK(experiments::nodal_error(body, equilibrium.coefficients(), exact) < 0.02);
    }
  }
  // What cannot be met is told.
  options.penetration = 1e-30;
  options.halvings = 0;
  Equilibrium strict(body, options);
  strict.set_lips(pairs);
  const auto squeezed = body.prescribed_values([&](const Vector3& x) { return Vector3(squeeze * x - x); });
  CHECK_THROWS_WITH(strict.solve({squeezed, 1, {}}), Catch::Contains("deep in itself at a cut (limit 1e-30)"));
}

TEST_CASE("A state that is handed on is found at once, and one that begins at rest goes there again") {
  Problem problem = finite_block(held_block(4, {4}));
  problem.loads.body_force = [](const Vector3&) { return Vector3(0.1, 0, -0.2); };
  const FiniteBody body(std::move(problem), experiments::neo_hookean(1, 0.45));
  Equilibrium first(body), second(body);
  static_cast<void>(first.solve({}));
  second.set_coefficients(first.coefficients(), 1);
  CHECK(second.solve({}).iterations <= 1);
  CHECK((second.coefficients() - first.coefficients()).norm() < 2e-3 * first.coefficients().norm());
  second.set_coefficients(VectorX::Zero(first.coefficients().size()));
  CHECK(second.solve({}).iterations > 1);
  CHECK((second.coefficients() - first.coefficients()).norm() < 1e-2 * first.coefficients().norm());
  CHECK_THROWS_AS(second.set_coefficients(first.coefficients(), std::nan("")), InputError);
}

TEST_CASE("What has no equilibrium is refused in words and leaves the state as it was") {
  const FiniteBody body(finite_block(held_block(3, {4, 5})), experiments::neo_hookean(1, 0.45));
  EquilibriumOptions options;
  options.halvings = 3;
  options.maximum_iterations = 20;
  Equilibrium equilibrium(body, options);
  equilibrium.solve({pressed_top(body, 0.1), 1, {}});
  const VectorX before = equilibrium.coefficients();
  CHECK_THROWS_AS(equilibrium.solve({pressed_top(body, 1.5), 1, {}}), NumericalError); // the top through the base
  CHECK(equilibrium.coefficients() == before);
  CHECK(equilibrium.solve({pressed_top(body, 0.15), 1, {}}).converged);
}

TEST_CASE("Bodies at finite strain refuse what they cannot use") {
  const auto law = experiments::neo_hookean(1, 0.45);
  CHECK_THROWS_AS(FiniteBody(finite_block(held_block(3, {4})), nullptr), InputError);
  CHECK_THROWS_AS(FiniteBody(finite_block(held_block(3, {})), law), InputError);
  FiniteOptions options;
  options.support_radius = 0.5;
  CHECK_THROWS_AS(FiniteBody(finite_block(held_block(3, {4})), law, options), InputError);
  options = {};
  options.pointwise_modulus = -1;
  CHECK_THROWS_AS(FiniteBody(finite_block(held_block(3, {4})), law, options), InputError);
  Problem strained = finite_block(held_block(3, {4}));
  strained.loads.initial_strain = 0.9 * Matrix3::Identity(); // a thousandth of the volume is left
  CHECK_THROWS_AS(FiniteBody(strained, law), InputError);
  const FiniteBody body(finite_block(held_block(3, {4})), law);
  Equilibrium equilibrium(body);
  FiniteLoading loading;
  loading.prescribed = {Vector3::Zero()};
  CHECK_THROWS_AS(equilibrium.solve(loading), InputError);
  loading = {};
  loading.tool = topology::ToolPose{};
  CHECK_THROWS_AS(equilibrium.solve(loading), InputError);
  CHECK_THROWS_AS(finite_method_from_string("secant"), InputError);
}
