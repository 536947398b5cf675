// Contact on a body that is new at every increment of a cut: patches without the fields of their unit forces.
#include "solvers/contact/lip_contact.hpp"
#include "tests/solvers/growing_scene.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// A way to discretise, and how near to the exact answer it comes.
struct Kind {
  const char* name;
  DiscretisationOptions options;
  double poisson_ratio = 0.4;
  // Of forces that are not in balance: under the loads, and under a unit force on a node.
  double residual = 1e-10, unit_residual = 1e-9;
  double held = 1e-8;  // of a unit force that the constraints take up
  double shift = 1e-8; // m, of 3.7 m
  // Relative, without fields against with them: of the tool's patch, and of lips beside it.
  double patch = 1e-9, lips = 1e-8, lips_of_tool = 1e-9;
  double open = 0;                        // relative, of lips without forces against no lips
  double betti = 1e-9, conjugate = 1e-12; // relative, of the work of spread forces
};

Kind kind_of(const char* name, Method method, SightRule sight) {
  Kind kind{.name = name, .options = {}};
  kind.options.method = method;
  kind.options.sight = sight;
  kind.options.estimate_condition = false;
  return kind;
}

Kind plain_galerkin() {
  return kind_of("galerkin", Method::galerkin, SightRule::diffraction);
}

/// Its system is the factor of the uncut body, bordered by what the cut appends: bounds of its own.
Kind appended_galerkin() {
  Kind kind = kind_of("appended", Method::galerkin, SightRule::appended);
  kind.residual = kind.unit_residual = 1e-8;
  kind.held = kind.shift = 1e-6;
  kind.patch = kind.lips_of_tool = 1e-8;
  kind.open = 1e-12;
  kind.betti = 1e-8;
  kind.conjugate = 3e-5; // a force leaves out spheres that the box of its place does not feel
  return kind;
}

Kind collocation(const char* name, double poisson_ratio) {
  Kind kind = kind_of(name, Method::collocation, SightRule::diffraction);
  kind.poisson_ratio = poisson_ratio;
  kind.unit_residual = 1e-8;
  kind.held = 1e-6;
  kind.shift = 1e-7;
  kind.lips_of_tool = 1e-8;
  return kind;
}

std::vector<Kind> kinds() {
  return {plain_galerkin(), appended_galerkin(), collocation("collocation", 0.3),
          collocation("collocation with pressures", 0.46)};
}

tests::GrowingScene scene_of(const Kind& kind) {
  tests::GrowingScene scene(kind.options.method, kind.options.sight == SightRule::appended);
  scene.poisson_ratio = kind.poisson_ratio;
  return scene;
}

/// The block after two increments of its cut, nodes exchanged on the way.
tests::GrowingScene grown_scene(const Kind& kind) {
  tests::GrowingScene scene = scene_of(kind);
  std::size_t exchanged = 0;
  for (int increment = 0; increment < 2; ++increment) {
    const SprinkleIncrement change = scene.grow();
    exchanged += change.removed.size() + change.added.positions.size();
  }
  REQUIRE(exchanged > 0);
  return scene;
}

/// A lip and some of the top ahead of the cut.
std::vector<int> patch_of(const tests::GrowingScene& scene) {
  std::vector<int> patch{scene.first(NodeKind::lip)};
  for (int i = 0; i < scene.nodes.size() && patch.size() < 6; ++i)
    if (scene.nodes.kinds[i] == NodeKind::surface && scene.nodes.normals[i].z() > 0.9 &&
        scene.nodes.positions[i].x() > 0.008)
      patch.push_back(i);
  return patch;
}

ContactState pulled(std::size_t nodes) {
  ContactState state;
  for (std::size_t c = 0; c < nodes; ++c)
    state.nodal_forces.emplace_back(0.01 * static_cast<double>(c % 3), -0.02, 0.03);
  return state;
}

} // namespace

TEST_CASE("Bodies on nodes that a growing cut has exchanged are in balance") {
  for (const Kind& kind : kinds()) {
    INFO(kind.name);
    const tests::GrowingScene scene = grown_scene(kind);
    const auto body = discretise(scene.problem(), kind.options);
    CHECK(body->residual(body->solve()) < kind.residual);
    const int lip = scene.first(NodeKind::lip);
    const std::vector<Field> responses = body->force_responses({lip});
    for (int axis = 0; axis < 3; ++axis) {
      CHECK(body->residual(responses[axis], {lip}, {Vector3::Unit(axis)}) < kind.unit_residual);
      CHECK(body->residual(responses[axis]) > 1e-3); // without the force
      Vector3 held = Vector3::Zero();
      for (const Vector3& force : body->constraint_forces(responses[axis]))
        held += force;
      CHECK((held + Vector3::Unit(axis)).norm() < kind.held);
    }
    const Vector3 inside(0.013, -0.011, -0.012), shift(1, 2, 3);
    const std::vector<Vector3> moved(scene.problem().prescribed.size(), shift);
    CHECK((body->at(inside, body->prescribed_response(moved)).displacement - shift).norm() < kind.shift);
  }
}

TEST_CASE("Lips on nodes that a growing cut has exchanged have the means of a body that knows no earlier cut") {
  for (const Kind& kind : kinds()) {
    INFO(kind.name);
    tests::GrowingScene scene = scene_of(kind);
    auto body = discretise(scene.problem(), kind.options);
    for (int increment = 0; increment < 2; ++increment) {
      scene.grow();
      body = discretise(scene.problem(), kind.options);
    }
    Problem apart = scene.problem(); // what is kept of a domain is not known of this one
    apart.domain = topology::make_box_domain({-0.03, -0.02, -0.03}, {0.03, 0.02, 0}, 0.005);
    const auto other = discretise(apart, kind.options);
    std::vector<int> lips;
    for (int i = 0; i < scene.nodes.size(); ++i)
      if (scene.nodes.kinds[i] == NodeKind::lip)
        lips.push_back(i);
    REQUIRE(lips.size() > 10);
    const Field field = body->solve();
    const MatrixX means = other->contact_displacements(lips, {field});
    CHECK((body->contact_displacements(lips, {field}) - means).norm() < 1e-12 * means.norm());
    for (const int lip : lips)
      CHECK((body->contact_point(lip) - other->contact_point(lip)).norm() < 1e-15);
  }
}

TEST_CASE("Cases of forces on nodes that a body does not have are refused") {
  for (const Kind& kind : kinds()) {
    INFO(kind.name);
    const tests::GrowingScene scene = scene_of(kind);
    const auto body = discretise(scene.problem(), kind.options);
    const int lip = scene.first(NodeKind::lip), none = scene.nodes.size();
    const MatrixX forces = MatrixX::Ones(3, 2);
    CHECK(body->condense_cases({lip}, forces, {lip}).at.cols() == 2);
    CHECK_THROWS_AS(body->condense_cases({lip}, forces, {none}), InputError);
    CHECK_THROWS_AS(body->condense_cases({lip}, forces, {-1}), InputError);
    CHECK_THROWS_AS(body->condense_cases({none}, forces, {lip}), InputError);
    CHECK_THROWS_AS(body->condense_cases({lip, lip}, forces, {lip}), InputError); // three rows for two nodes
  }
}

TEST_CASE("Contact on a patch without fields is that on one with them") {
  for (const Kind& kind : kinds()) {
    INFO(kind.name);
    const tests::GrowingScene scene = grown_scene(kind);
    const auto body = discretise(scene.problem(), kind.options);
    const std::vector<int> nodes = patch_of(scene);
    REQUIRE(nodes.size() == 6);
    const std::vector<LipPair> pairs = lip_pairs(scene.nodes);
    const ContactPatch full = condense(*body, nodes);
    ContactPatch bare = condense_without_fields(*body, nodes);
    CHECK((bare.compliance - full.compliance).norm() < kind.patch * full.compliance.norm());
    const ContactState state = pulled(nodes.size());
    const VectorX with = deform(full, state).coefficients;
    CHECK((deform(*body, bare, state).coefficients - with).norm() < kind.patch * with.norm());
    CHECK_THROWS_AS(deform(bare, state), InputError);
    const LipPatch wanted = condense_lips(*body, pairs, LipCondition::sticking, &full),
                   lips = condense_lips(*body, pairs, LipCondition::sticking, &bare);
    CHECK((lips.compliance - wanted.compliance).norm() < kind.lips * wanted.compliance.norm());
    CHECK((lips.tool_of_lips - wanted.tool_of_lips).norm() < kind.lips * wanted.tool_of_lips.norm());
    CHECK((lips.lips_of_tool - wanted.lips_of_tool).norm() < kind.lips_of_tool * wanted.lips_of_tool.norm());
    extend_responses(*body, 2, bare);
    CHECK(bare.responses.size() == 6);
    extend_responses(*body, 1000, bare);
    REQUIRE(bare.responses.size() == full.responses.size());
    CHECK((deform(bare, state).coefficients - with).norm() < kind.patch * with.norm());
  }
}

TEST_CASE("Tool and lips without fields act together as they do superposed") {
  for (const Kind& kind : {plain_galerkin(), appended_galerkin()}) {
    INFO(kind.name);
    const tests::GrowingScene scene = grown_scene(kind);
    const auto body = discretise(scene.problem(), kind.options);
    const std::vector<int> nodes = patch_of(scene);
    const std::vector<LipPair> pairs = lip_pairs(scene.nodes);
    const ContactPatch full = condense(*body, nodes);
    ContactPatch bare = condense_without_fields(*body, nodes);
    LipPatch lips = condense_lips(*body, pairs, LipCondition::sticking, &bare);
    // The fields come with it where the method knows the rest by them alone.
    CHECK(lips.responses.empty() == (kind.options.sight == SightRule::appended));
    lips.responses.clear();
    CutContactState state;
    state.tool = pulled(nodes.size());
    state.lips.forces = VectorX::LinSpaced(lips.compliance.cols(), -0.01, 0.02);
    const VectorX together = deform(*body, bare, lips, state).coefficients;
    CHECK_THROWS_AS(deform(full, lips, state), InputError);
    CutContactState open = state; // no forces: as without lips
    open.lips.forces.resize(0);
    const VectorX alone = deform(*body, bare, state.tool).coefficients;
    CHECK((deform(*body, bare, lips, open).coefficients - alone).norm() <= kind.open * alone.norm());
    open.lips.forces = VectorX::Zero(1);
    CHECK_THROWS_AS(deform(*body, bare, lips, open), InputError);
    extend_responses(*body, 1, lips);
    CHECK(std::ssize(lips.responses) == lips.modes);
    CHECK_FALSE(has_fields(lips));
    extend_responses(*body, 1000, lips);
    REQUIRE(std::ssize(lips.responses) == lips.compliance.cols());
    CHECK((deform(full, lips, state).coefficients - together).norm() < kind.patch * together.norm());
    bare.nodes.pop_back();
    lips.responses.clear();
    CHECK_THROWS_AS(deform(*body, bare, lips, state), InputError); // another patch's
  }
}

TEST_CASE("A spread force on a cut body does as much work as the point force it is near to") {
  for (const Kind& kind : {plain_galerkin(), appended_galerkin()}) {
    INFO(kind.name);
    const tests::GrowingScene scene = grown_scene(kind);
    const auto body = discretise(scene.problem(), kind.options);
    const ForcePattern a{{{0.01, 0.002, -0.01}, {0.012, 0.001, -0.011}}, {{0.5, 0, 0.2}, {0.5, 0.1, 0}}};
    const ForcePattern b{{{-0.01, -0.01, -0.005}}, {{0, 0, -1}}};
    const std::vector<Field> responses = body->pattern_responses({a, b});
    const MatrixX conjugate = body->pattern_displacements({a, b}, responses);
    CHECK(conjugate(0, 1) == Approx(conjugate(1, 0)).epsilon(kind.betti));
    const Vector3 u = body->at(b.points[0], responses[1]).displacement;
    CHECK(conjugate(1, 1) == Approx(-u.z()).epsilon(kind.conjugate));
  }
}
