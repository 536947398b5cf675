#include "solvers/published/published.hpp"

#include "solvers/published/step.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/tip_pattern.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

// Irregular nodes in a box of 0.1 x 0.08 x 0.06 m: a jittered lattice whose boundary nodes stay on their faces.
const Vector3 extent(0.1, 0.08, 0.06);
NodeCloud box_cloud(int n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto jitter = [&] { return 0.4 * (std::ldexp(static_cast<double>(random() >> 11), -53) - 0.5); };
  NodeCloud cloud;
  const double h = extent.x() / n;
  const std::array<int, 3> count{n, static_cast<int>(std::lround(extent.y() / h)),
                                 static_cast<int>(std::lround(extent.z() / h))};
  for (int i = 0; i <= count[0]; ++i)
    for (int j = 0; j <= count[1]; ++j)
      for (int k = 0; k <= count[2]; ++k) {
        const std::array<int, 3> index{i, j, k};
        Vector3 x, normal = Vector3::Zero();
        int faces = 0;
        for (int a = 0; a < 3; ++a) {
          const bool low = index[a] == 0, high = index[a] == count[a];
          const double step = jitter();
          x[a] = extent[a] * (index[a] + (low || high ? 0 : step)) / count[a];
          normal[a] = high ? 1 : (low ? -1 : 0);
          faces += low || high ? 1 : 0;
        }
        const NodeKind kind = faces == 0 ? NodeKind::interior : (faces == 1 ? NodeKind::surface : NodeKind::edge);
        cloud.add(x, h, kind, faces > 0 ? Vector3(normal.normalized()) : normal);
      }
  return cloud;
}

bool at_base(const Vector3& x) {
  return x.z() < 1e-12;
}

Matrix3 linear_gradient() {
  Matrix3 g;
  g << 0.011, -0.004, 0.007, 0.003, -0.009, 0.002, -0.006, 0.005, 0.008;
  return g;
}
Vector3 linear_field(const Vector3& x) {
  return Vector3(1e-3, -2e-3, 5e-4) + linear_gradient() * x;
}

Problem clamped_box(int n, std::uint64_t seed) {
  Problem problem;
  problem.nodes = box_cloud(n, seed);
  problem.material = {8000, 0.3, 1000};
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (at_base(problem.nodes.positions[i]))
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  return problem;
}

// The same with a node amid the top face as the tip, held last.
struct Tipped {
  Problem problem;
  DiscretisationOptions options;
};
Tipped tipped_box(int n, std::uint64_t seed) {
  Tipped tipped{clamped_box(n, seed), {}};
  double nearest = 1;
  for (int i = 0; i < tipped.problem.nodes.size(); ++i) {
    const double d = (tipped.problem.nodes.positions[i] - Vector3(0.05, 0.04, 0.06)).norm();
    if (d < nearest) {
      nearest = d;
      tipped.options.tip_node = i;
    }
  }
  tipped.options.method = Method::published;
  tipped.problem.prescribed.push_back({tipped.options.tip_node, {true, true, true}, Vector3(1e-3, -2e-3, -4e-3)});
  return tipped;
}

} // namespace

TEST_CASE("The published scheme passes the linear patch test", "[published]") {
  const int n = GENERATE(4, 7); // dense and sparse factors
  const double poisson = GENERATE(0.0, 0.3, 0.45);
  Problem problem = clamped_box(n, 3);
  problem.material.poisson_ratio = poisson;
  const Material material = problem.material;
  for (Prescribed& entry : problem.prescribed)
    entry.value = linear_field(problem.nodes.positions[entry.node]);
  // One side holds its normal component alone; its tangential rows stay tractions.
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] == NodeKind::surface && problem.nodes.normals[i].x() < -0.5)
      problem.prescribed.push_back({i, {true, false, false}, linear_field(problem.nodes.positions[i])});
  problem.loads.traction = [material](const Vector3&, const Vector3& normal) {
    return Vector3(tests::stress(material, linear_gradient()) * normal);
  };
  const auto body = make_published(problem, {Method::published});
  CHECK((body->report().nodes > 200) == (n == 7));
  const Field field = body->solve();
  const VectorX displacements = body->nodal_displacements(field);
  double error = 0, size = 0;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3 exact = linear_field(problem.nodes.positions[i]);
    error = std::max(error, (displacements.segment<3>(3 * i) - exact).norm());
    size = std::max(size, exact.norm());
  }
  CHECK(error / size <= 1e-10);
  const PointState inside = body->at(Vector3(0.043, 0.037, 0.031), field);
  CHECK((inside.gradient - linear_gradient()).norm() < 1e-10);
  CHECK((inside.stress - tests::stress(material, linear_gradient())).norm() < 1e-6);
  CHECK(body->residual(field, {}, {}) < 1e-9);
}

TEST_CASE("Collocation rows agree with finite differences of the approximation", "[published]") {
  const NodeCloud cloud = box_cloud(5, 9);
  const Material material{8000, 0.35, 1000};
  const Spheres spheres(cloud.positions, cloud.spacings, 2.0);
  // Coefficients of a manufactured field; the rows must give the operators on u_h, whatever u_h is.
  std::vector<Vector3> alpha(cloud.size());
  for (int j = 0; j < cloud.size(); ++j) {
    const Vector3& x = cloud.positions[j];
    alpha[j] = 1e-3 * Vector3(std::sin(40 * x.x() + 9 * x.z()), std::cos(31 * x.y() - 20 * x.x()),
                              std::sin(25 * x.x() * x.y() / 0.05 + 50 * x.z()));
  }
  const tests::VectorField u = [&](const Vector3& x) {
    ShapeFunctions shape;
    REQUIRE(evaluate(spheres, x, shape));
    Vector3 sum = Vector3::Zero();
    for (int k = 0; k < shape.size(); ++k)
      sum += shape.value[k] * alpha[shape.nodes[k]];
    return sum;
  };
  const double step = 2e-3 * 0.02;
  for (const Vector3& x : {Vector3(0.051, 0.043, 0.029), Vector3(0.024, 0.061, 0.017), Vector3(0.083, 0.02, 0.045)}) {
    const Vector3 normal = Vector3(0.3, -0.5, 0.9).normalized();
    ShapeFunctions shape;
    REQUIRE(evaluate_second(spheres, x, shape));
    Vector3 equilibrium = Vector3::Zero(), traction = Vector3::Zero();
    for (int k = 0; k < shape.size(); ++k) {
      equilibrium += equilibrium_block(shape, k, material) * alpha[shape.nodes[k]];
      traction += traction_block(shape, k, normal, material) * alpha[shape.nodes[k]];
    }
    const Vector3 expected_traction = tests::stress(material, tests::gradient(u, x, step)) * normal;
    const Vector3 expected_equilibrium = tests::stress_divergence(material, u, x, step);
    CHECK((traction - expected_traction).norm() < 1e-5 * expected_traction.norm());
    CHECK((equilibrium - expected_equilibrium).norm() < 1e-3 * expected_equilibrium.norm());
  }
}

TEST_CASE("The condensed tip is the row residual of the full solution", "[published]") {
  const Tipped tipped = tipped_box(5, 2);
  const auto body = make_published(tipped.problem, tipped.options);
  const Vector3 motion = tipped.problem.prescribed.back().value;
  const Field field = body->solve();
  // The tip's unknown, not its displacement, is what the tool moves.
  CHECK((field.coefficients.segment<3>(3 * tipped.options.tip_node) - motion).norm() < 1e-15);
  CHECK((body->nodal_displacements(field).segment<3>(3 * tipped.options.tip_node) - motion).norm() > 1e-5);

  const Vector3 row_force = body->constraint_forces(field).back();
  const Vector3 condensed = published_tip_force(*body, motion);
  CHECK((row_force - condensed).norm() < 1e-9 * row_force.norm());
  CHECK(condensed.norm() > 0);

  // The same from explicit blocks: traction row of the tip and the unknowns of all nodes.
  const PublishedTip tip = tip_stiffness(*body);
  const Spheres spheres(tipped.problem.nodes.positions, tipped.problem.nodes.spacings, published_support_radius);
  ShapeFunctions shape;
  REQUIRE(evaluate_second(spheres, tipped.problem.nodes.positions[tip.node], shape));
  Vector3 traction = Vector3::Zero();
  for (int k = 0; k < shape.size(); ++k)
    traction += traction_block(shape, k, tipped.problem.nodes.normals[tip.node], tipped.problem.material) *
                field.coefficients.segment<3>(3 * shape.nodes[k]);
  CHECK((tip.row_stiffness * motion - traction).norm() < 1e-9 * traction.norm());
  CHECK(tip.measure == Approx(std::pow(0.1 / 5, 2)));
  CHECK((tip.measure * tip.row_stiffness - tip.stiffness).norm() < 1e-12 * tip.stiffness.norm());
}

TEST_CASE("Forces and loads of the published scheme answer to its own rows", "[published]") {
  Problem problem = clamped_box(5, 4);
  problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -9810); };
  problem.loads.traction = [](const Vector3& x, const Vector3&) { return Vector3(20 * x.x(), 0, -5); };
  const auto body = make_published(problem, {Method::published});
  const Field loaded = body->solve();
  CHECK(loaded.load_factor == 1);
  CHECK(body->residual(loaded, {}, {}) < 1e-9);

  int inside = 0, above = 0;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    if (problem.nodes.kinds[i] == NodeKind::interior)
      inside = i;
    if (problem.nodes.kinds[i] == NodeKind::surface && problem.nodes.normals[i].z() > 0.5)
      above = i;
  }
  const std::vector<Field> responses = body->force_responses({inside, above});
  REQUIRE(responses.size() == 6);
  for (int k = 0; k < 6; ++k) {
    const int node = k < 3 ? inside : above;
    CHECK(body->residual(responses[k], {node}, {Vector3::Unit(k % 3)}) < 1e-9);
    CHECK(body->residual(responses[k], {node}, {Vector3::Zero()}) > 0.1);
    CHECK(responses[k].load_factor == 0);
  }
  // Prescribed displacements act alone and by superposition.
  std::vector<Vector3> values(problem.prescribed.size(), Vector3(1e-3, 0, -2e-3));
  Field moved = body->prescribed_response(values);
  const VectorX displacements = body->nodal_displacements(moved);
  for (int i = 0; i < problem.nodes.size(); ++i)
    CHECK((displacements.segment<3>(3 * i) - Vector3(1e-3, 0, -2e-3)).norm() < 1e-12);
  moved.add(1, loaded);
  CHECK(body->residual(moved, {}, {}) < 1e-9);
  CHECK(std::isfinite(body->report().condition_estimate));
}

TEST_CASE("The condition estimate is that of the scaled system", "[published]") {
  const auto body = make_published(clamped_box(4, 8), {Method::published});
  const double condition = body->report().condition_estimate;
  CHECK(condition > 10);
  CHECK(condition < 1e8);
  // Lengths and stiffness scale out: the same cloud in millimetres of a stiffer body has the same condition.
  Problem scaled = clamped_box(4, 8);
  scaled.material.young_modulus *= 1e6;
  for (Vector3& x : scaled.nodes.positions)
    x *= 1000;
  for (double& h : scaled.nodes.spacings)
    h *= 1000;
  CHECK(make_published(scaled, {Method::published})->report().condition_estimate == Approx(condition).epsilon(1e-6));
}

TEST_CASE("The published scheme refuses problems it cannot solve", "[published]") {
  Problem problem = clamped_box(4, 8);
  problem.prescribed.clear();
  CHECK_THROWS_AS(make_published(problem, {Method::published}), InputError);

  problem = clamped_box(4, 8); // three components of one node leave the rotations free
  problem.prescribed.resize(1);
  CHECK_THROWS_AS(make_published(problem, {Method::published}), NumericalError);

  problem = clamped_box(4, 8);
  problem.prescribed.push_back(problem.prescribed.front());
  CHECK_THROWS_WITH(make_published(problem, {Method::published}), Catch::Contains("prescribed twice"));

  problem = clamped_box(4, 8);
  problem.nodes.normals[0].setZero();
  CHECK_THROWS_WITH(make_published(problem, {Method::published}), Catch::Contains("node 0"));

  Tipped tipped = tipped_box(4, 8);
  tipped.problem.prescribed.pop_back();
  CHECK_THROWS_AS(make_published(tipped.problem, tipped.options), InputError);
  tipped = tipped_box(4, 8);
  tipped.problem.prescribed.erase(tipped.problem.prescribed.begin(), tipped.problem.prescribed.end() - 1);
  CHECK_THROWS_WITH(make_published(tipped.problem, tipped.options), Catch::Contains("nothing but tip"));
  CHECK_THROWS_AS(tip_stiffness(*make_published(clamped_box(4, 8), {Method::published})), InputError);
}

TEST_CASE("The real-time step gives the force of the general scheme", "[published]") {
  const double spacing = 0.005;
  const tests::TipPattern pattern = tests::tip_pattern(spacing);
  REQUIRE(pattern.nodes.size() == 34);
  const Material material{8000, 0.3, 1000};
  const Vector3 normal = Vector3(0.2, -0.4, 0.8).normalized(), contact(0.1, 0.2, -0.3);
  const Vector3 displacement(1e-3, 5e-4, -2e-3);
  NodeCloud placed = pattern.nodes;
  PublishedStep published(34, material);
  // The step before this one, on another cloud, must leave nothing behind.
  REQUIRE(published.step(placed, pattern.held, 0, displacement).status == StepStatus::solved);
  tests::place(pattern, contact, normal, placed);
  const PublishedStepResult result = published.step(placed, pattern.held, 0, displacement);
  REQUIRE(result.status == StepStatus::solved);

  Problem problem;
  problem.nodes = placed;
  problem.material = material;
  for (int i = 0; i < 34; ++i)
    if (pattern.held[i] != 0)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed.push_back({0, {true, true, true}, displacement});
  DiscretisationOptions options;
  options.tip_node = 0;
  const auto body = make_published(problem, options);
  REQUIRE(body->report().grown_supports == 0);
  const PublishedTip tip = tip_stiffness(*body);
  CHECK((result.stiffness - tip.stiffness).norm() < 1e-9 * tip.stiffness.norm());
  CHECK((result.force - tip.stiffness * displacement).norm() < 1e-9 * result.force.norm());
  CHECK(result.worst_moment_condition == Approx(body->report().worst_moment_condition).epsilon(1e-6));
  const Field field = body->solve();
  for (int i = 0; i < 34; ++i) {
    Vector3 moved = Vector3::Zero();
    for (int axis = 0; axis < 3; ++axis)
      moved += displacement[axis] * published.response(i, axis);
    CHECK((moved - field.coefficients.segment<3>(3 * i)).norm() < 1e-9 * displacement.norm());
  }
}

TEST_CASE("The real-time step reports what it cannot solve", "[published]") {
  const tests::TipPattern pattern = tests::tip_pattern(0.005);
  PublishedStep published(34, {8000, 0.3, 1000});
  const Vector3 displacement(0, 0, -1e-3);
  CHECK(published.step(pattern.nodes, pattern.held, 34, displacement).status == StepStatus::wrong_size);
  CHECK(published.step(pattern.nodes, std::span(pattern.held).first(33), 0, displacement).status ==
        StepStatus::wrong_size);
  NodeCloud stray = pattern.nodes;
  stray.positions[20] = Vector3(1, 1, 1);
  const PublishedStepResult apart = published.step(stray, pattern.held, 0, displacement);
  CHECK(apart.status == StepStatus::unsound_support);
  CHECK(apart.node == 20);
  // Two nodes with the same rows.
  NodeCloud twins = pattern.nodes;
  twins.positions[5] = twins.positions[4];
  CHECK(published.step(twins, pattern.held, 0, displacement).status == StepStatus::singular);
  CHECK(published.step(pattern.nodes, pattern.held, 0, displacement).status == StepStatus::solved);
  CHECK_THROWS_AS(PublishedStep(3, {8000, 0.3, 1000}), InputError);
  CHECK_THROWS_AS(PublishedStep(34, {8000, 0.5, 1000}), InputError);
  CHECK_THROWS_AS(PublishedStep(34, {8000, 0.3, 1000}, 0), InputError);
}
