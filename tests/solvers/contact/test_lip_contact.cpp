#include "solvers/algebra/linear_complementarity.hpp"
#include "solvers/contact/lip_contact.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// `coupling`: how much the pairs move one another, against how much each moves itself.
LipPatch random_lips(int pairs, int modes, unsigned seed, double coupling) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  LipPatch lips;
  lips.modes = modes;
  for (int p = 0; p < pairs; ++p)
    lips.pairs.push_back({2 * p, 2 * p + 1, Vector3::UnitZ()});
  const int n = modes * pairs;
  const MatrixX root = MatrixX::NullaryExpr(n, n, [&] { return normal(random); });
  lips.compliance = coupling / n * root * root.transpose() + MatrixX::Identity(n, n);
  lips.base_opening = VectorX::NullaryExpr(n, [&] { return normal(random); });
  return lips;
}

} // namespace

TEST_CASE("Frictionless lips solve the linear complementarity problem of unilateral contact", "[lip_contact]") {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const LipPatch lips = random_lips(30, 1, seed, 300);
    const LipState state = close_lips(lips, lips.base_opening, 1e-12);
    const ComplementaritySolution exact = solve_complementarity(lips.compliance, lips.base_opening, {}, 1e-12);
    REQUIRE(state.converged);
    REQUIRE(exact.converged);
    CHECK((state.forces - exact.forces).norm() < 1e-8 * (1 + exact.forces.norm()));
  }
}

TEST_CASE("Sticking lips are either open and free of force or closed, held in all components and pressed",
          "[lip_contact]") {
  int with_both = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const LipPatch lips = random_lips(12, 3, seed, 0.1);
    const LipState state = close_lips(lips, lips.base_opening, 1e-12);
    if (!state.converged)
      continue; // a pair at the brink may suit neither open nor closed: that is said, not hidden
    int closed = 0;
    for (int p = 0; p < 12; ++p)
      if (state.closed[p]) {
        ++closed;
        CHECK(state.forces[3 * p] >= 0);
        CHECK(state.openings.segment<3>(3 * p).norm() == 0);
      } else {
        CHECK(state.openings[3 * p] >= -1e-12);
        CHECK(state.forces.segment<3>(3 * p).norm() == 0);
      }
    with_both += closed > 0 && closed < 12 ? 1 : 0;
    CHECK((state.openings - lips.base_opening - lips.compliance * state.forces).norm() <
          1e-9 * (1 + state.forces.norm()));
  }
  CHECK(with_both >= 18);
}

TEST_CASE("A guess of the closed pairs changes the way, not the outcome", "[lip_contact]") {
  const LipPatch lips = random_lips(25, 1, 7, 250);
  const LipState cold = close_lips(lips, lips.base_opening, 1e-12);
  const LipState warm = close_lips(lips, lips.base_opening, 1e-12, cold.closed);
  CHECK(warm.rounds == 1);
  CHECK(warm.forces == cold.forces);
  const LipState wrong = close_lips(lips, lips.base_opening, 1e-12, std::vector<char>(25, 1));
  CHECK((wrong.forces - cold.forces).norm() < 1e-9 * (1 + cold.forces.norm()));
}

TEST_CASE("A tool on a body with lips feels the body with its closed pairs held together", "[lip_contact]") {
  // One candidate and one pair: o = o0 + A l + t f, u = C f + t l, with f along z. The lips start closed and are
  // pressed together (t < 0 lowers the opening under a push in -z), so u = (C - t^2 / A) f.
  ContactPatch patch;
  patch.nodes = {0};
  patch.rest = {Vector3::Zero()};
  patch.spacings = {0.01};
  patch.normals = {Vector3::UnitZ()};
  patch.compliance = 2e-3 * Matrix3::Identity();
  patch.base_displacement = VectorX::Zero(3);
  LipPatch lips;
  lips.pairs = {{1, 2, Vector3::UnitZ()}};
  lips.modes = 1;
  lips.compliance = MatrixX::Constant(1, 1, 1e-3);
  lips.base_opening = VectorX::Zero(1);
  lips.tool_of_lips = MatrixX::Zero(3, 1);
  lips.tool_of_lips(2, 0) = 1e-3;
  lips.lips_of_tool = lips.tool_of_lips.transpose();
  const CutContactState pushed = prescribe(patch, lips, {Vector3(0, 0, -1e-3)});
  CHECK(pushed.lips.closed[0]);
  CHECK(pushed.tool.nodal_forces[0].z() == Approx(-1e-3 / (2e-3 - 1e-6 / 1e-3)));
  CHECK(pushed.lips.forces[0] == Approx(1.0).margin(1e-12).epsilon(1e-9));
  const CutContactState pulled = prescribe(patch, lips, {Vector3(0, 0, 1e-3)});
  CHECK_FALSE(pulled.lips.closed[0]);
  CHECK(pulled.tool.nodal_forces[0].z() == Approx(0.5));
  CHECK(pulled.lips.openings[0] == Approx(0.5e-3));
}

TEST_CASE("Lip nodes find their partner across the sheet", "[lip_contact]") {
  NodeCloud nodes;
  const double h = 0.01;
  const Vector3 normal = Vector3(1, 2, 3).normalized();
  for (int k = 0; k < 5; ++k) {
    const Vector3 x(0.01 * k, 0, 0);
    nodes.add(x, h, NodeKind::interior);
    nodes.add(x + lip_offset * h * normal, h, NodeKind::lip, -normal);
    nodes.add(x - lip_offset * h * normal, h, NodeKind::lip, normal);
  }
  nodes.add(Vector3(1, 0, 0), h, NodeKind::lip, normal); // alone: its partner lay outside
  const std::vector<LipPair> pairs = lip_pairs(nodes);
  REQUIRE(pairs.size() == 5);
  for (const LipPair& pair : pairs) {
    CHECK((nodes.positions[pair.plus] - nodes.positions[pair.minus]).dot(pair.normal) > 0);
    CHECK((pair.normal - normal).norm() < 1e-12);
  }
}

TEST_CASE("Lip conditions have names, and an unknown one is refused with them", "[lip_contact]") {
  for (const LipCondition condition : {LipCondition::open, LipCondition::frictionless, LipCondition::sticking})
    CHECK(lip_condition_from_string(to_string(condition)) == condition);
  CHECK_THROWS_WITH(lip_condition_from_string("glued"), Catch::Contains("glued") && Catch::Contains("sticking"));
}
