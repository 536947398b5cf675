// Coulomb friction under a tool, against Cattaneo and Mindlin on an exact half-space and against its own laws on a
// block.
#include "solvers/contact/friction.hpp"
#include "solvers/contact/solver.hpp"
#include "tests/support/pressed_block.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using solvers::ContactCondition;
using solvers::ContactOptions;
using solvers::ContactPatch;
using solvers::ContactState;
using solvers::Method;
using solvers::press;
using tests::pressed_block;
using topology::SphereTip;
using topology::ToolPose;

namespace {

ContactOptions with_friction(double coefficient) {
  ContactOptions options;
  options.condition = ContactCondition::frictional;
  options.friction = coefficient;
  return options;
}

/// The half-space z < 0 seen from a grid of (2n + 1)^2 nodes, by the solutions of Boussinesq and Cerruti; a node's own
/// displacement is that at the middle of a disc of its area under even traction.
ContactPatch half_space(int n, double h, double shear_modulus, double nu) {
  ContactPatch patch;
  for (int i = -n; i <= n; ++i)
    for (int j = -n; j <= n; ++j) {
      patch.nodes.push_back(static_cast<int>(std::ssize(patch.nodes)));
      patch.rest.emplace_back(h * i, h * j, 0);
      patch.spacings.push_back(h);
      patch.normals.push_back(Vector3::UnitZ());
    }
  const auto count = std::ssize(patch.nodes);
  patch.base_displacement = VectorX::Zero(3 * count);
  patch.compliance = MatrixX::Zero(3 * count, 3 * count);
  const double scale = 1 / (2 * std::numbers::pi * shear_modulus);
  for (Eigen::Index c = 0; c < count; ++c)
    for (Eigen::Index d = 0; d < count; ++d) {
      Matrix3 green = Matrix3::Zero();
      if (c == d) {
        const double radius = h / std::sqrt(std::numbers::pi);
        green.diagonal() = 2 / radius * Vector3(1 - nu / 2, 1 - nu / 2, 1 - nu);
      } else {
        const Vector3 way = patch.rest[c] - patch.rest[d];
        const double r = way.norm();
        for (int a = 0; a < 2; ++a) {
          for (int b = 0; b < 2; ++b)
            green(a, b) = nu * way[a] * way[b] / (r * r * r) + (a == b ? (1 - nu) / r : 0);
          green(2, a) = (1 - 2 * nu) / 2 * way[a] / (r * r);
          green(a, 2) = -green(2, a);
        }
        green(2, 2) = (1 - nu) / r;
      }
      patch.compliance.block<3, 3>(3 * c, 3 * d) = scale * green;
    }
  return patch;
}

double elastic_energy(const ContactPatch& patch, const ContactState& state) {
  double energy = 0;
  for (std::size_t c = 0; c < patch.nodes.size(); ++c)
    energy +=
        0.5 * state.nodal_forces[c].dot(Vector3(state.displacement.segment<3>(3 * static_cast<Eigen::Index>(c)) -
                                                patch.base_displacement.segment<3>(3 * static_cast<Eigen::Index>(c))));
  return energy;
}

} // namespace

TEST_CASE("A pressed sphere that is pushed sideways follows Cattaneo and Mindlin, and sticks within their circle") {
  // nu = 1/2: pressure and friction do not couple, as the theory assumes.
  const double shear = 2000;
  const double nu = 0.5;
  const double radius = 0.1;
  const double a = 0.006;
  const double h = a / 9;
  const double coefficient = 0.4;
  const ContactPatch patch = half_space(12, h, shear, nu);
  const SphereTip tool{radius};
  const double depth = a * a / radius;
  const ContactState pressed = press(patch, tool, {{0, 0, -depth}, Vector3::UnitZ()}, with_friction(coefficient));
  REQUIRE(pressed.converged);
  const double force = pressed.tool_force.z();
  CHECK(force == Approx(8 * shear / (1 - nu) * a * a * a / (3 * radius)).epsilon(0.03)); // Hertz
  CHECK(std::hypot(pressed.tool_force.x(), pressed.tool_force.y()) < 1e-6 * force);
  const double limit = coefficient * force;
  const double full = 3 * limit * (2 - nu) / (16 * a * shear); // m, way at which all of it slips
  ContactState state = pressed;
  for (const double part : {0.2, 0.4, 0.6, 0.8, 0.95}) {
    state = press(patch, tool, {{part * full, 0, -depth}, Vector3::UnitZ()}, with_friction(coefficient), &state);
    REQUIRE(state.converged);
    const double exact = limit * (1 - std::pow(1 - part, 1.5));
    INFO("part " << part << ": " << -state.tool_force.x() / exact);
    CHECK(-state.tool_force.x() == Approx(exact).epsilon(0.04));
    CHECK(state.friction_work >= 0);
    const double stuck_radius = a * std::sqrt(1 - part); // (1 - Q / mu P)^(1/3) a
    for (std::size_t c = 0; c < patch.nodes.size(); ++c) {
      if (state.active[c] == 0)
        continue;
      const double r = patch.rest[c].norm();
      const double normal = (state.nodal_forces[c] - state.along[c]).norm();
      CHECK(state.along[c].norm() <= (1 + 1e-6) * coefficient * normal);
      if (r < stuck_radius - 1.5 * h)
        CHECK_FALSE(solvers::slips(state.along[c], coefficient * normal));
      if (r > stuck_radius + 1.5 * h)
        CHECK(solvers::slips(state.along[c], coefficient * normal));
    }
  }
  for (const double part : {1.5, 2.5})
    state = press(patch, tool, {{part * full, 0, -depth}, Vector3::UnitZ()}, with_friction(coefficient), &state);
  CHECK(std::hypot(state.tool_force.x(), state.tool_force.y()) ==
        Approx(coefficient * state.tool_force.z()).epsilon(5e-3));
}

TEST_CASE("Without a coefficient friction changes nothing") {
  for (Method method : {Method::collocation, Method::galerkin}) {
    const ContactPatch& patch = pressed_block(method).patch;
    const ToolPose pose{{0.001, 0, -0.003}, Vector3::UnitZ()};
    const ContactState plain = press(patch, SphereTip{0.01}, pose);
    const ContactState none = press(patch, SphereTip{0.01}, pose, with_friction(0));
    CHECK((plain.tool_force - none.tool_force).norm() < 1e-6 * plain.tool_force.norm());
    CHECK(none.friction_work == 0);
  }
}

TEST_CASE("A tool dragged far meets friction times pressure against its way, and the same on the way back") {
  const double coefficient = 0.3;
  for (Method method : {Method::collocation, Method::galerkin}) {
    const ContactPatch& patch = pressed_block(method).patch;
    const SphereTip tool{0.04};
    const double depth = 0.002;
    ContactState state = press(patch, tool, {{-0.002, 0, -depth}, Vector3::UnitZ()}, with_friction(coefficient));
    double work = 0;
    double heat = state.friction_work;
    const auto drag = [&](double to) {
      for (int i = 1; i <= 20; ++i) {
        const Vector3 point(state.pose.point.x() + (to - state.pose.point.x()) / (21 - i), 0, -depth);
        const Vector3 way = point - state.pose.point;
        const Vector3 before = state.tool_force;
        state = press(patch, tool, {point, Vector3::UnitZ()}, with_friction(coefficient), &state);
        REQUIRE(state.converged);
        CHECK(state.friction_work >= 0);
        work -= 0.5 * (before + state.tool_force).dot(way);
        heat += state.friction_work;
      }
    };
    const auto check_slipping = [&](double way) { // everywhere, against the tool's way
      double pressure = 0;
      double against = 0;
      for (std::size_t c = 0; c < patch.nodes.size(); ++c) {
        const double normal = (state.nodal_forces[c] - state.along[c]).norm();
        CHECK(state.along[c].norm() == Approx(coefficient * normal).epsilon(1e-6).margin(1e-9));
        pressure += normal;
        against += way * state.along[c].x(); // the tool drags the body along
      }
      CHECK(against == Approx(coefficient * pressure).epsilon(0.02));
    };
    drag(0.003);
    INFO(solvers::to_string(method));
    check_slipping(1);
    const double energy = elastic_energy(patch, state);
    work = 0;
    heat = 0;
    drag(-0.003);
    check_slipping(-1);
    drag(0.003);
    // Once around: what the tool has put in, friction has taken.
    CHECK(heat > 0);
    CHECK(work == Approx(heat + elastic_energy(patch, state) - energy).epsilon(0.03));
  }
}

TEST_CASE("What sticks goes on with the tool, and a contact on other nodes goes on from its memory") {
  const double coefficient = 0.5;
  const ContactPatch& patch = pressed_block(Method::galerkin).patch;
  const SphereTip tool{0.02};
  const ContactOptions options = with_friction(coefficient);
  ContactState state = press(patch, tool, {{0, 0, -0.002}, Vector3::UnitZ()}, options);
  state = press(patch, tool, {{0.0004, 0.0002, -0.002}, Vector3::UnitZ()}, options, &state);
  REQUIRE(state.tool_force.x() < 0);
  const auto memory = solvers::remember(patch, state, coefficient);
  REQUIRE(memory);
  ContactState empty;
  empty.memory = memory;
  // The same nodes: the same contact, at that pose and after.
  const ContactState again = press(patch, tool, state.pose, options, &empty);
  CHECK((again.tool_force - state.tool_force).norm() < 1e-3 * state.tool_force.norm());
  const ToolPose next{{0.0008, 0, -0.002}, Vector3::UnitZ()};
  const Vector3 there = press(patch, tool, next, options, &state).tool_force;
  CHECK((press(patch, tool, next, options, &empty).tool_force - there).norm() < 5e-3 * there.norm());
  // Without memory the contact has to begin anew: nothing holds it sideways.
  const Vector3 fresh = press(patch, tool, next, options).tool_force;
  CHECK(std::abs(fresh.x()) < 0.5 * std::abs(there.x()));
}

TEST_CASE("A turned tool carries along what sticks to it; friction below 0 is refused") {
  const ToolPose from{{0, 0, 0.01}, Vector3::UnitZ()};
  const ToolPose to{{0.001, 0, 0.01}, Vector3(1, 0, 1).normalized()};
  // A quarter turn's half about y: from (0, 0, 0.02), 1 cm up the axis, to 1 cm along the new one.
  const Vector3 way = solvers::tool_motion(from, to, Vector3(0, 0, 0.02));
  CHECK((Vector3(0, 0, 0.02) + way - (to.point + 0.01 * to.axis)).norm() < 1e-15);
  CHECK_THROWS_AS(press(pressed_block(Method::galerkin).patch, SphereTip{0.01}, from, with_friction(-0.1)), InputError);
}
