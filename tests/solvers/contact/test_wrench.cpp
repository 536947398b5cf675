// The torque that goes with the force on a tool or a blade, against levers, energies and the supports.
#include "solvers/contact/blade_contact.hpp"
#include "solvers/contact/solver.hpp"

#include "tests/support/cut_block.hpp"
#include "tests/support/pressed_block.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;
using tests::place;
using tests::pressed_block;
using tests::PressedBlock;
using topology::FlatPunch;
using topology::SphereTip;
using topology::ToolPose;
using topology::ToolShape;

namespace {

const Vector3 oblique_axis = Vector3(0.3, -0.2, 1).normalized();

double stored_under(const ContactPatch& patch, const ContactState& state) {
  double sum = 0;
  for (std::size_t c = 0; c < patch.nodes.size(); ++c)
    sum += 0.5 * state.nodal_forces[c].dot(place(patch, state, c) - patch.rest[c]);
  return sum;
}

/// A blade of three pieces on a compliance of its own, as it stands at an angle about `axis` through `about`.
struct TurningBlade {
  BladePatch patch;
  std::vector<Vector3> points; // m, of its pieces at angle 0
  Vector3 about = {0.01, -0.02, 0.03}, axis = Vector3(1, 2, -1).normalized();

  TurningBlade() {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    const auto vector = [&](double size) {
      return Vector3(size * Vector3(normal(random), normal(random), normal(random)));
    };
    for (int c = 0; c < 3; ++c) {
      const Vector3 push = vector(1).normalized();
      patch.contacts.push_back({vector(0.02), push, push.unitOrthogonal(), 0.01});
      points.push_back(patch.contacts.back().point + 0.004 * push);
    }
    const MatrixX root = MatrixX::NullaryExpr(3, 3, [&] { return normal(random); });
    patch.compliance = 1e-3 * (root * root.transpose() + 3 * MatrixX::Identity(3, 3));
    patch.base = patch.free = VectorX::Zero(3);
  }
  [[nodiscard]] std::vector<Vector3> places(double angle) const {
    std::vector<Vector3> result;
    for (const Vector3& point : points)
      result.emplace_back(about + Eigen::AngleAxisd(angle, axis) * (point - about));
    return result;
  }
  [[nodiscard]] BladeState at(double angle) const {
    const std::vector<Vector3> now = places(angle);
    VectorX advance(3);
    for (Eigen::Index c = 0; c < 3; ++c) {
      const EdgeContact& contact = patch.contacts[static_cast<std::size_t>(c)];
      advance[c] = contact.push.dot(now[static_cast<std::size_t>(c)] - contact.point);
    }
    return push_blade(patch, advance);
  }
};

} // namespace

TEST_CASE("A ball without friction has no torque about its centre, wherever it presses", "[wrench]") {
  const double radius = 0.012;
  for (const Method method : {Method::collocation, Method::galerkin})
    for (const Vector3& axis : {Vector3(Vector3::UnitZ()), oblique_axis}) {
      const PressedBlock& on = pressed_block(method);
      const ToolPose pose = topology::pose_at(SphereTip{radius}, Vector3(0.02, -0.01, -0.003), axis);
      const ContactState state = press(on.patch, SphereTip{radius}, pose);
      REQUIRE(state.converged);
      const Vector3 centre = pose.point + radius * pose.axis;
      const double scale = radius * state.tool_force.norm();
      CHECK(torque_about(state, centre).norm() < 1e-6 * scale);
      // About the tip it is that of the force in the centre.
      CHECK((state.tool_torque - radius * pose.axis.cross(state.tool_force)).norm() < 1e-6 * scale);
      if (axis == oblique_axis)
        CHECK(state.tool_torque.norm() > 0.01 * scale);
    }
}

TEST_CASE("The torque of a punch off the middle is its force times the lever of the nodal forces", "[wrench]") {
  const PressedBlock& on = pressed_block(Method::galerkin);
  const ToolPose pose{{0.02, 0.012, -0.002}, Vector3::UnitZ()};
  const ContactState state = press(on.patch, FlatPunch{0.012, 0.05}, pose);
  REQUIRE(state.converged);
  // All forces act along z in the plane of the end face: their middle is the lever.
  Vector3 middle = Vector3::Zero();
  for (std::size_t c = 0; c < on.patch.nodes.size(); ++c)
    middle += state.nodal_forces[c].z() * place(on.patch, state, c);
  middle /= -state.tool_force.z();
  const Vector3 lever = middle - pose.point;
  CHECK(std::abs(lever.z()) < 1e-9);
  REQUIRE(lever.norm() > 1e-4); // the block ends beside it
  CHECK(lever.norm() < 0.012);
  CHECK((state.tool_torque - lever.cross(state.tool_force)).norm() < 1e-10 * state.tool_torque.norm());
  // Another point of reference: r x F, and the sum over the nodes about it.
  const Vector3 other{-0.01, 0.04, 0.02};
  Vector3 sum = Vector3::Zero();
  for (std::size_t c = 0; c < on.patch.nodes.size(); ++c)
    sum -= (place(on.patch, state, c) - other).cross(state.nodal_forces[c]);
  CHECK((torque_about(state, other) - sum).norm() < 1e-12);
  CHECK((torque_about(state, other) - state.tool_torque - (pose.point - other).cross(state.tool_force)).norm() < 1e-15);
}

TEST_CASE("To turn a punch takes the work that its torque says", "[wrench]") {
  const PressedBlock& on = pressed_block(Method::galerkin);
  const ToolShape punch = FlatPunch{0.012, 0.05};
  const Vector3 point{0.01, 0.004, -0.003};
  const double angle = 1e-5;
  for (const Vector3& about : {Vector3(Vector3::UnitX()), Vector3(Vector3::UnitY())}) {
    const auto energy = [&](double turned) {
      const ToolPose pose{point, Eigen::AngleAxisd(turned, about) * Vector3::UnitZ()};
      ContactOptions options;
      options.gap_tolerance = 1e-12;
      return stored_under(on.patch, press(on.patch, punch, pose, options));
    };
    const ContactState state = press(on.patch, punch, {point, Vector3::UnitZ()});
    const double slope = (energy(angle) - energy(-angle)) / (2 * angle);
    CHECK(slope == Approx(-state.tool_torque.dot(about)).epsilon(1e-3));
    CHECK(std::abs(slope) > 1e-5);
  }
}

TEST_CASE("The supports bear the torque of the tool", "[wrench]") {
  // Of the body at rest, as linear elasticity has it: the forces act where their nodes are at rest.
  for (const ContactCondition condition :
       {ContactCondition::frictionless, ContactCondition::frictional, ContactCondition::bonded}) {
    const PressedBlock& on = pressed_block(Method::galerkin);
    const ToolPose pose = topology::pose_at(SphereTip{0.01}, Vector3(0.012, -0.006, -0.003), oblique_axis);
    ContactOptions options;
    options.condition = condition;
    options.friction = 0.4;
    const ContactState state = press(on.patch, SphereTip{0.01}, pose, options);
    Vector3 moved = Vector3::Zero(); // what the displacements add to the levers
    for (std::size_t c = 0; c < on.patch.nodes.size(); ++c)
      moved -= (place(on.patch, state, c) - on.patch.rest[c]).cross(state.nodal_forces[c]);
    const std::vector<Vector3> points = on.body->constraint_points(),
                               held = on.body->constraint_forces(deform(on.patch, state));
    Vector3 borne = Vector3::Zero();
    for (std::size_t i = 0; i < held.size(); ++i)
      borne += (points[i] - pose.point).cross(held[i]);
    const double scale = 0.03 * state.tool_force.norm(); // its height over the base
    INFO(static_cast<int>(condition) << " off by " << (borne - state.tool_torque + moved).norm() / scale);
    CHECK((borne - (state.tool_torque - moved)).norm() < 1e-6 * scale);
    CHECK(moved.norm() > 1e-3 * scale);
  }
}

TEST_CASE("To turn a blade takes the work that the torque of its edge says, and the torque opposes", "[wrench]") {
  const TurningBlade blade;
  const BladeState state = blade.at(0);
  REQUIRE(state.forces.minCoeff() > 0);
  const BladeTorque torque = blade_torque(blade.patch, state, blade.places(0), blade.about);
  CHECK(torque.blade == torque.edge); // without flanks
  const double angle = 1e-6;
  const double slope = (blade.at(angle).stored - blade.at(-angle).stored) / (2 * angle);
  CHECK(slope == Approx(-torque.edge.dot(blade.axis)).epsilon(1e-6));
  // Turned on by an angle either way, the change of its torque is against that.
  for (const double turn : {0.01, -0.01}) {
    const BladeTorque there = blade_torque(blade.patch, blade.at(turn), blade.places(turn), blade.about);
    CHECK((there.edge - torque.edge).dot(blade.axis) * turn < 0);
  }
  const Vector3 other{0.05, 0.01, 0};
  const BladeTorque about = blade_torque(blade.patch, state, blade.places(0), other);
  CHECK((about.edge - torque.edge - (blade.about - other).cross(state.edge_force)).norm() < 1e-14);
  CHECK_THROWS_AS(blade_torque(blade.patch, state, {}, other), InputError);
}

TEST_CASE("The drag of the flanks turns the blade about where the faces are that it rubs", "[wrench]") {
  const tests::CutBlock block = tests::cut_block(6, false, 3);
  Problem problem = tests::problem_of(block, {1, 0.3, 0});
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.positions[i].z() < -0.5 + 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.z() < -0.5 + 1e-9; };
  const auto body = discretise(problem, {});
  const tests::CutFrame& frame = block.frame;
  const std::vector<EdgeContact> contacts{{frame.origin, frame.ahead, frame.normal, 0.2}};
  std::vector<FlankPoint> flanks;
  for (const double along : {-0.1, 0.15})
    flanks.push_back({frame.origin - 0.1 * frame.ahead + along * frame.tangent, frame.normal, 0.02});
  const ForcePattern drag = drag_pattern(flanks, 0.1, frame.ahead, problem.nodes.spacings.front());
  const Field base = body->solve();
  const BladePatch patch = condense_blade(*body, base, contacts, 0.15, {}, drag);
  const BladeState state = push_blade(patch, VectorX::Constant(1, 0.1), 1);
  REQUIRE(state.forces[0] > 0);
  const Field field = deform(patch, state, base);
  const Vector3 about{0.3, -0.2, 0.4}, edge = frame.origin + 0.05 * frame.ahead;
  Vector3 at_rest = Vector3::Zero(), dragged = Vector3::Zero();
  for (std::size_t k = 0; k < drag.points.size(); ++k) {
    const Vector3 u = body->at(drag.points[k], field).displacement;
    at_rest -= (drag.points[k] - about).cross(drag.forces[k]);
    dragged -= (drag.points[k] + u - about).cross(drag.forces[k]);
  }
  const BladeTorque torque = blade_torque(patch, state, {edge}, about);
  CHECK((torque.blade - torque.edge - dragged).norm() < 1e-9 * dragged.norm());
  CHECK((at_rest - dragged).norm() > 1e-3 * dragged.norm());
  CHECK((torque.edge - (edge - about).cross(state.edge_force)).norm() < 1e-14);
  const BladePatch again = condense_blade(*body, base, contacts, 0.15, {}, drag, &patch);
  CHECK(again.drag_torques == patch.drag_torques);
  CHECK(again.drag_torque == patch.drag_torque);
}
