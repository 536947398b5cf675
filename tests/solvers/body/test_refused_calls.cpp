// Calls that cannot be answered are refused in words, whoever makes them: indices, sizes, poses, numbers.
#include "tests/support/pressed_block.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <limits>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <typename Call>
void check_refused(const Call& call, const char* word) {
  CAPTURE(word);
  CHECK_THROWS_AS(call(), InputError);
  CHECK_THROWS_WITH(call(), Contains(word));
}

} // namespace

TEST_CASE("A body refuses nodes that it does not have, and fields and forces of another size") {
  for (const Method method : {Method::galerkin, Method::collocation, Method::published}) {
    CAPTURE(to_string(method));
    Problem problem = held_box({0, 0, 0}, {0.04, 0.04, 0.03}, 0.01, 0, {5e3, 0.3, 1000});
    DiscretisationOptions options = options_for(method);
    const std::vector<int> top = top_nodes(problem);
    if (method == Method::published) {
      options.tip_node = top.front();
      problem.prescribed.push_back({top.front(), {true, true, true}, Vector3::Zero()});
    }
    const auto body = discretise(problem, options);
    const int count = body->problem().nodes.size();
    const Field own = body->solve();
    const Field none;
    REQUIRE_NOTHROW(body->at({0.02, 0.02, 0.02}, own));
    for (const int node : {-1, count, 9999}) {
      check_refused([&] { return body->force_responses({node}); }, "does not exist");
      check_refused([&] { return body->contact_point(node); }, "does not exist");
      check_refused([&] { return body->contact_displacement(node, own); }, "does not exist");
      check_refused([&] { return body->contact_compliance({node}); }, "does not exist");
      check_refused([&] { return body->sphere_radius(node); }, "does not exist");
      check_refused([&] { return body->residual(own, {node}, {Vector3::Zero()}); }, "does not exist");
    }
    check_refused([&] { return body->force_response({top[0], top[1]}, {Vector3::UnitZ()}); }, "1 forces for 2");
    check_refused([&] { return body->residual(own, {top[0]}, {}); }, "0 forces for 1");
    check_refused([&] { return body->case_responses({top[0]}, MatrixX::Zero(2, 1)); }, "three rows a node");
    check_refused([&] { return body->at({0.02, 0.02, 0.02}, none); }, "another body's");
    check_refused([&] { return body->nodal_displacements(none); }, "another body's");
    check_refused([&] { return body->contact_displacement(top[0], none); }, "another body's");
    check_refused([&] { return body->constraint_forces(none); }, "another body's");
    check_refused([&] { return body->residual(none); }, "another body's");
    if (method != Method::published) {
      check_refused([&] { return body->load_work(none); }, "another body's");
      check_refused([&] { return body->pattern_responses({{{Vector3(0.02, 0.02, 0.02)}, {}}}); }, "0 forces on 1");
    }
    Field sum = own;
    check_refused([&] { sum.add(1, none); }, "not of the same body");
    for (const double radius : {-2.0, not_a_number}) {
      options.support_radius = radius;
      check_refused([&] { return discretise(problem, options); }, "support radius");
    }
    options.support_radius = 0;
    options.quadrature = 0;
    check_refused([&] { return discretise(problem, options); }, "background cells");
  }
}

TEST_CASE("A press refuses tools and poses that are none, and a state of another patch") {
  const PressedBlock& block = pressed_block(Method::galerkin);
  const ContactPatch& patch = block.patch;
  const topology::SphereTip ball{0.01};
  const topology::ToolPose pose{{0.001, 0.002, -0.002}, Vector3::UnitZ()};
  const ContactState state = press(patch, ball, pose);
  const auto pressed = [&](const topology::ToolShape& tool, const topology::ToolPose& at,
                           const ContactState* previous = nullptr) {
    return [&, tool, at, previous] { return press(patch, tool, at, {}, previous); };
  };
  for (const double radius : {0.0, -1.0, not_a_number})
    check_refused(pressed(topology::SphereTip{radius}, pose), "radius");
  for (const ContactState* previous : {static_cast<const ContactState*>(nullptr), &state}) {
    check_refused(pressed(ball, {{not_a_number, 0, 0}, Vector3::UnitZ()}, previous), "reference point");
    check_refused(pressed(ball, {pose.point, {0, 0, not_a_number}}, previous), "axis");
    check_refused(pressed(ball, {pose.point, {0, 0, 2}}, previous), "length 2");
    check_refused(pressed(ball, {pose.point, Vector3::Zero()}, previous), "length 0");
  }
  ContactOptions options;
  options.maximum_iterations = 0;
  check_refused([&] { return press(patch, ball, pose, options); }, "iterations");
  options = {};
  options.friction = -0.1;
  check_refused([&] { return press(patch, ball, pose, options); }, "friction");

  const ContactPatch one = condense(*block.body, {patch.nodes.front()});
  const ContactState elsewhere = press(one, ball, pose);
  check_refused(pressed(ball, pose, &elsewhere), "another patch's");
  check_refused([&] { return deform(patch, elsewhere); }, "another patch's");
  check_refused([&] { return deform(*block.body, patch, elsewhere); }, "another patch's");
  check_refused([&] { return among(patch, elsewhere, patch.nodes); }, "another patch's");
  const ContactState taken = among(one, elsewhere, patch.nodes);
  CHECK(press(patch, ball, pose, {}, &taken).tool_force.z() == Approx(state.tool_force.z()).epsilon(1e-6));

  std::vector<Vector3> displacements(patch.nodes.size(), Vector3::Zero());
  displacements.back().x() = not_a_number;
  check_refused([&] { return prescribe(patch, displacements); }, "must be finite");
  displacements.pop_back();
  check_refused([&] { return prescribe(patch, displacements); }, "displacements for");
}
