#include "solvers/contact/solver.hpp"

#include "experiments/analytic/half_space.hpp"
#include "solvers/contact/half_space.hpp"
#include "tests/support/pressed_block.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

using namespace spherecut;
using solvers::ContactCondition;
using solvers::ContactOptions;
using solvers::ContactPatch;
using solvers::ContactState;
using solvers::Method;
using solvers::press;
using tests::held_box;
using tests::options_for;
using tests::place;
using tests::pressed_block;
using tests::PressedBlock;
using tests::top_nodes;
using topology::FlatPunch;
using topology::SphereTip;
using topology::ToolPose;
using topology::ToolShape;

namespace {

const std::array<Method, 2> contact_methods{Method::collocation, Method::galerkin};

Vector3 reaction(const PressedBlock& on, const ContactState& state) {
  Vector3 total = Vector3::Zero();
  for (const Vector3& force : on.body->constraint_forces(solvers::deform(on.patch, state)))
    total += force;
  return total;
}

} // namespace

TEST_CASE("A pressed tool leaves no penetration and no tension, and its force is the reaction") {
  for (Method method : contact_methods)
    for (const ToolShape& tool : {ToolShape(SphereTip{0.01}), ToolShape(FlatPunch{0.012, 0.05})})
      for (const Vector3& axis : {Vector3(0, 0, 1), Vector3(0.2, -0.1, 1)}) {
        const PressedBlock& on = pressed_block(method);
        const ToolPose pose = topology::pose_at(tool, Vector3(0.002, -0.001, -0.003), axis);
        const ContactState state = press(on.patch, tool, pose);
        INFO(solvers::to_string(method) << ", tool " << tool.index() << ", axis " << axis.transpose());
        REQUIRE(state.converged);
        CHECK(state.active_nodes > 0);
        CHECK(state.largest_penetration < 1e-8);
        Vector3 total = Vector3::Zero();
        for (std::size_t c = 0; c < on.patch.nodes.size(); ++c) {
          const Vector3& force = state.nodal_forces[c];
          total += force;
          if (!state.active[c]) {
            CHECK(force.isZero(0));
            continue;
          }
          // Frictionless: along the tool's outward normal, pushing; the end face's under a punch.
          const Vector3 x = place(on.patch, state, c);
          const Vector3 normal = tool.index() == 0 ? topology::tool_normal(tool, pose, x) : Vector3(-pose.axis);
          CHECK(force.dot(normal) >= 0);
          CHECK((force - force.dot(normal) * normal).norm() < 1e-4 * state.tool_force.norm());
          if (tool.index() == 0 && force.norm() > 0)
            CHECK(std::abs(topology::tool_distance(tool, pose, x)) < 1e-8);
        }
        CHECK((state.tool_force + total).norm() < 1e-14);
        CHECK(state.tool_force.dot(pose.axis) > 0); // the body pushes the tool out
        // Every newton that the tool puts in comes out at the base.
        CHECK((reaction(on, state) - state.tool_force).norm() < 1e-7 * state.tool_force.norm());
        // The field built from the forces moves the candidates as the contact solution says.
        const solvers::Field field = solvers::deform(on.patch, state);
        for (std::size_t c = 0; c < on.patch.nodes.size(); ++c)
          CHECK((on.patch.rest[c] + on.body->contact_displacement(on.patch.nodes[c], field) - place(on.patch, state, c))
                    .norm() < 1e-8);
        CHECK(on.body->residual(field, on.patch.nodes, state.nodal_forces) < 1e-7);
      }
}

TEST_CASE("A plate on a block between smooth walls presses as Hooke's law says, from half a micrometre on") {
  // Uniaxial strain depth / height, all of the top in contact: force = (lambda + 2 mu) area depth / height.
  const Vector3 lower(-0.02, -0.02, -0.02), upper(0.02, 0.02, 0);
  solvers::Problem problem = held_box(lower, upper, 0.005, 0.2, {5e3, 0.3, 1000}, 4);
  problem.prescribed.clear();
  problem.touched_from = Vector3::UnitZ();
  problem.prescribed_region = [](const Vector3&, const Vector3& normal, int axis) {
    return axis == 2 ? normal.z() < -0.5 : std::abs(normal[axis]) > 0.5;
  };
  std::vector<int> top;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    for (int axis = 0; axis < 3; ++axis)
      if (x[axis] == lower[axis] || (axis < 2 && x[axis] == upper[axis])) {
        solvers::Prescribed wall{i, {false, false, false}, Vector3::Zero()};
        wall.components[axis] = true;
        problem.prescribed.push_back(wall);
      }
    if (x.z() == 0)
      top.push_back(i);
  }
  const solvers::Material& material = problem.material;
  const double stiffness = (material.lame_lambda() + 2 * material.shear_modulus()) * 0.04 * 0.04 / 0.02; // N/m
  for (Method method : contact_methods) {
    const auto body = solvers::discretise(problem, options_for(method));
    const ContactPatch patch = solvers::condense(*body, top);
    for (const double depth : {0.5e-6, 2e-6, 1e-4}) {
      const ContactState state = press(patch, FlatPunch{0.05, 0.05}, {{0, 0, -depth}, Vector3::UnitZ()});
      INFO(solvers::to_string(method) << ", depth " << depth << ", " << state.tool_force.z() / (stiffness * depth));
      CHECK(state.converged);
      CHECK(state.active_nodes == static_cast<int>(top.size()));
      for (std::size_t c = 0; c < top.size(); ++c)
        CHECK(std::abs(place(patch, state, c).z() + depth) < 1e-9);
      // The points of galerkin's background cells leave 8e-5 of a linear field on irregular nodes.
      CHECK(state.tool_force.z() == Approx(stiffness * depth).epsilon(method == Method::collocation ? 1e-6 : 1e-4));
    }
  }
}

TEST_CASE("At the rim of a leaning punch a node comes to rest on end face or flank") {
  // With these spheres it alternates between the two, from which no round of the linearised contact gets out.
  const solvers::Problem problem = held_box({-0.03, -0.03, -0.03}, {0.03, 0.03, 0}, 0.0075, 0.2, {5e3, 0.45, 1000}, 3);
  solvers::DiscretisationOptions options = options_for(Method::galerkin);
  options.support_radius = 2;
  const auto body = solvers::discretise(problem, options);
  const ContactPatch patch = solvers::condense(*body, top_nodes(problem));
  const ToolShape tool = FlatPunch{0.012, 0.05};
  const ToolPose pose = topology::pose_at(tool, Vector3(0.002, -0.001, -0.003), Vector3(0.2, -0.1, 1));
  const ContactState state = press(patch, tool, pose);
  CHECK(state.converged);
  CHECK(state.largest_penetration < 1e-8);
  int on_flank = 0;
  for (std::size_t c = 0; c < patch.nodes.size(); ++c) {
    const Vector3 arm = place(patch, state, c) - pose.point;
    const double beside = (arm - arm.dot(pose.axis) * pose.axis).norm() - 0.012;
    on_flank += state.active[c] != 0 && std::abs(beside) < 1e-6 ? 1 : 0;
  }
  CHECK(on_flank == 1);
}

TEST_CASE("A shallow sphere on a thick block presses about as Hertz says") {
  // Radius and depth such that the contact spans a few spacings and the block is seven contact radii wide.
  const double radius = 0.06, depth = 0.0012;
  const solvers::Material& material = pressed_block(Method::galerkin).body->problem().material;
  const double exact = experiments::hertz_contact(material, radius, depth).force;
  for (Method method : contact_methods) {
    const ContactState state =
        press(pressed_block(method).patch, SphereTip{radius}, {{0, 0, -depth}, Vector3::UnitZ()});
    const double ratio = state.tool_force.z() / exact;
    INFO(solvers::to_string(method) << " " << ratio);
    // The held base at 3.5 contact radii stiffens it: about 1 + 1.1 a / thickness = 1.3 by itself.
    CHECK(ratio > 1.1);
    CHECK(ratio < 1.6);
  }
}

TEST_CASE("A tool that does not touch feels nothing") {
  for (Method method : contact_methods)
    for (ContactCondition condition : {ContactCondition::frictionless, ContactCondition::bonded}) {
      ContactOptions options;
      options.condition = condition;
      const ContactState state =
          press(pressed_block(method).patch, SphereTip{0.01}, {{0, 0, 1e-4}, Vector3::UnitZ()}, options);
      CHECK(state.tool_force.isZero(0));
      CHECK(state.active_nodes == 0);
      CHECK(state.contact_radius == 0);
      CHECK(state.converged);
      CHECK(state.displacement.norm() == 0);
    }
}

TEST_CASE("Pressing on and drawing back traces one force curve, back to nothing") {
  for (Method method : contact_methods) {
    const ContactPatch& patch = pressed_block(method).patch;
    const SphereTip tool{0.012};
    std::vector<double> depths, forces;
    ContactState state;
    bool first = true;
    for (int step = 0; step <= 16; ++step) {
      const double depth = 0.0004 * (step <= 8 ? step : 16 - step) - 0.0002;
      state = press(patch, tool, {{0, 0, -depth}, Vector3::UnitZ()}, {}, first ? nullptr : &state);
      first = false;
      CHECK(state.converged);
      depths.push_back(depth);
      forces.push_back(state.tool_force.z());
    }
    CHECK(forces.front() == 0);
    CHECK(forces.back() == 0); // clear of the surface again
    CHECK(state.active_nodes == 0);
    for (int step = 0; step < 8; ++step) {
      CHECK(forces[step + 1] > forces[step]);
      CHECK(forces[16 - step] == Approx(forces[step]).margin(1e-6 * forces[8])); // elastic: the way back is the same
    }
    // And the path is that of presses from rest.
    CHECK(press(patch, tool, {{0, 0, -depths[8]}, Vector3::UnitZ()}).tool_force.z() == Approx(forces[8]).epsilon(1e-6));
  }
}

TEST_CASE("A bonded punch is stiffer than a frictionless one and carries its nodes along") {
  for (Method method : contact_methods) {
    const ContactPatch& patch = pressed_block(method).patch;
    const FlatPunch tool{0.012, 0.05};
    ContactOptions bonded;
    bonded.condition = ContactCondition::bonded;
    const ToolPose pose{{0, 0, -0.002}, Vector3::UnitZ()};
    const ContactState slip = press(patch, tool, pose), stick = press(patch, tool, pose, bonded);
    CHECK(stick.tool_force.z() > slip.tool_force.z());
    CHECK(stick.tool_force.z() < 1.25 * slip.tool_force.z());
    CHECK(stick.active_nodes >= slip.active_nodes);
    CHECK(stick.largest_penetration < 1e-8);
    // Under the end face the nodes go down with it; a sideways pull then drags them and is resisted.
    for (std::size_t c = 0; c < patch.nodes.size(); ++c)
      if (stick.active[c])
        CHECK(stick.displacement[3 * static_cast<Eigen::Index>(c) + 2] == Approx(-0.002).epsilon(1e-6));
    const ContactState dragged = press(patch, tool, {{0.001, 0, -0.002}, Vector3::UnitZ()}, bonded, &stick);
    CHECK(dragged.tool_force.x() < 0);
    for (std::size_t c = 0; c < patch.nodes.size(); ++c)
      if (stick.active[c]) {
        const auto at = 3 * static_cast<Eigen::Index>(c);
        CHECK((dragged.displacement.segment<3>(at) - stick.displacement.segment<3>(at) - Vector3(0.001, 0, 0)).norm() <
              1e-9);
      }
    const ContactState back = press(patch, tool, pose, bonded, &dragged);
    CHECK((back.tool_force - stick.tool_force).norm() < 0.02 * stick.tool_force.norm());
  }
}

TEST_CASE("A press as deep as the tip's radius converges") {
  for (Method method : contact_methods)
    for (double radius : {0.012, 0.015, 0.018}) { // a node slips off a ball of about its own spacing
      const ContactState state =
          press(pressed_block(method).patch, SphereTip{radius}, {{0, 0, -radius}, Vector3::UnitZ()});
      INFO(solvers::to_string(method) << " radius " << radius);
      CHECK(state.converged);
      CHECK(state.iterations < 80); // of two sub-steps
      CHECK(state.largest_penetration < 1e-8);
      CHECK(state.tool_force.z() > 0);
    }
}

TEST_CASE("A ball presses the same whichever way its shaft leans") {
  // Deep enough that its tangent cone matters; the shaft itself stays clear of the block.
  const Vector3 centre(0.001, 0.002, 0.0035);
  for (Method method : contact_methods) {
    const PressedBlock& on = pressed_block(method);
    const auto force = [&](const ToolShape& tool, const Vector3& axis) {
      const ContactState state = press(on.patch, tool, {centre - topology::tip_radius(tool) * axis, axis});
      REQUIRE(state.converged);
      return state.tool_force;
    };
    const Vector3 upright = force(SphereTip{0.01}, Vector3::UnitZ());
    const Vector3 leaning = Vector3(1, 0.3, 1).normalized();
    INFO(solvers::to_string(method) << ": " << upright.transpose() << " N upright");
    CHECK((force(SphereTip{0.01}, leaning) - upright).norm() < 1e-6 * upright.norm());
    const ToolShape scope = topology::Laparoscope{0.01, 0.003, 0.3, centre + 0.25 * leaning};
    CHECK((force(scope, leaning) - upright).norm() < 1e-6 * upright.norm());
  }
}

TEST_CASE("Prescribed displacements of the patch are met and give the condensed stiffness") {
  for (Method method : contact_methods) {
    const ContactPatch& patch = pressed_block(method).patch;
    std::vector<Vector3> values;
    for (std::size_t c = 0; c < patch.nodes.size(); ++c)
      values.emplace_back(1e-4 * std::sin(0.1 * static_cast<double>(c)), 0, -1e-3);
    const ContactState state = solvers::prescribe(patch, values);
    for (std::size_t c = 0; c < values.size(); ++c)
      CHECK((state.displacement.segment<3>(3 * static_cast<Eigen::Index>(c)) - values[c]).norm() < 1e-12);
    VectorX stacked(patch.compliance.rows());
    for (std::size_t c = 0; c < values.size(); ++c)
      stacked.segment<3>(3 * static_cast<Eigen::Index>(c)) = values[c];
    const VectorX forces = patch.compliance.fullPivLu().solve(stacked);
    for (std::size_t c = 0; c < values.size(); ++c)
      CHECK((state.nodal_forces[c] - forces.segment<3>(3 * static_cast<Eigen::Index>(c))).norm() <
            1e-9 * forces.norm());
    // Held where it is, without a force, the patch is its own middle and as wide as it is.
    const ContactState still = solvers::prescribe(patch, std::vector<Vector3>(values.size(), Vector3::Zero()));
    Vector3 middle = Vector3::Zero();
    for (const Vector3& x : patch.rest)
      middle += x / static_cast<double>(patch.rest.size());
    CHECK(still.tool_force.norm() == 0);
    CHECK((still.centre - middle).norm() < 1e-12);
    double farthest = 0;
    for (std::size_t c = 0; c < values.size(); ++c)
      farthest = std::max(farthest, (patch.rest[c] - middle).norm() + 0.5 * patch.spacings[c]);
    CHECK(still.contact_radius == Approx(farthest));
    values.pop_back();
    CHECK_THROWS_AS(solvers::prescribe(patch, values), InputError);
  }
}

TEST_CASE("Turning body and tool by right angles turns the force") {
  // Right angles keep a box a box, and cells, shares and background cells turn with it.
  Matrix3 turn;
  turn << 0, 0, 1, 1, 0, 0, 0, 1, 0; // z to x, x to y, y to z
  for (Method method : contact_methods) {
    const solvers::Problem problem = held_box({0, 0, 0}, {0.05, 0.04, 0.03}, 0.01, 0.2, {5e3, 0.3, 1000}, 9);
    solvers::Problem turned = problem;
    const Vector3 lower = turn * Vector3::Zero(), upper = turn * Vector3(0.05, 0.04, 0.03);
    turned.domain = topology::make_box_domain(lower, upper, 0.01);
    for (Vector3& x : turned.nodes.positions)
      x = (turn * x).eval();
    for (Vector3& n : turned.nodes.normals)
      n = (turn * n).eval();
    turned.prescribed_region = [&](const Vector3& x, const Vector3& n) {
      return problem.prescribed_region(turn.transpose() * x, turn.transpose() * n);
    };
    const std::vector<int> nodes = top_nodes(problem);
    const ContactPatch patch = solvers::condense(*solvers::discretise(problem, options_for(method)), nodes);
    const ContactPatch other = solvers::condense(*solvers::discretise(turned, options_for(method)), nodes);
    const ToolShape tool = SphereTip{0.012};
    const Vector3 point(0.024, 0.021, 0.027), axis = Vector3(0.1, 0.2, 1).normalized();
    const ContactState state = press(patch, tool, {point, axis});
    const ContactState same = press(other, tool, {turn * point, turn * axis});
    INFO(solvers::to_string(method));
    const double difference = (turn * state.tool_force - same.tool_force).norm() / state.tool_force.norm();
    CHECK(difference < 1e-9);
    CHECK(same.active == state.active);
  }
}

TEST_CASE("A coupled far boundary follows the half-space under the tool's force") {
  // All faces but the top are far; a unit force then moves them as Boussinesq says and the force leaves through them.
  for (Method method : contact_methods) {
    solvers::Problem problem = held_box({-0.04, -0.04, -0.04}, {0.04, 0.04, 0}, 0.01, 0.1, {5e3, 0.3, 1000}, 3);
    problem.prescribed.clear();
    problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.z() < -1e-9; };
    for (int i = 0; i < problem.nodes.size(); ++i) {
      const Vector3& x = problem.nodes.positions[i];
      if (x.cwiseAbs().maxCoeff() > 0.04 - 1e-9)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    }
    const auto body = solvers::discretise(problem, options_for(method));
    const std::vector<int> nodes = top_nodes(problem);
    const solvers::HalfSpaceCoupling coupling;
    const ContactPatch patch = solvers::condense(*body, nodes, coupling);
    const ContactState state = press(patch, SphereTip{0.03}, {{0, 0, -0.002}, Vector3::UnitZ()});
    REQUIRE(state.converged);
    const solvers::Field field = solvers::deform(patch, state);
    const std::vector<Vector3> points = body->constraint_points();
    double worst = 0, largest = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Vector3 exact = solvers::half_space_displacement(problem.material, -state.tool_force, coupling.origin,
                                                             coupling.inward, points[k]);
      worst = std::max(worst, (field.prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)) - exact).norm());
      largest = std::max(largest, exact.norm());
    }
    CHECK(worst < 1e-10 * largest);
    Vector3 total = Vector3::Zero();
    for (const Vector3& force : body->constraint_forces(field))
      total += force;
    INFO(solvers::to_string(method));
    CHECK((total - state.tool_force).norm() < 1e-6 * state.tool_force.norm());
    const double exact = experiments::hertz_contact(problem.material, 0.03, 0.002).force;
    CHECK(state.tool_force.z() == Approx(exact).epsilon(0.25)); // contact radius of one spacing: coarse
  }
}

TEST_CASE("Candidates that cannot be pressed on are refused") {
  for (Method method : contact_methods) {
    const solvers::Discretisation& body = *pressed_block(method).body;
    CHECK_THROWS_AS(solvers::condense(body, {}), InputError);
    CHECK_THROWS_WITH(solvers::condense(body, {-1}), Catch::Contains("does not exist"));
    CHECK_THROWS_WITH(solvers::condense(body, {body.problem().nodes.size()}), Catch::Contains("does not exist"));
    CHECK_THROWS_WITH(solvers::condense(body, {body.problem().prescribed.front().node}), Catch::Contains("is fixed"));
  }
}
