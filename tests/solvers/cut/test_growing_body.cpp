#include "solvers/contact/lip_contact.hpp"
#include "solvers/cut/growing_body.hpp"
#include "tests/solvers/growing_scene.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::solvers;
using Scene = spherecut::tests::GrowingScene;

namespace {

Vector3 sum_of(const std::vector<Vector3>& forces) {
  Vector3 total = Vector3::Zero();
  for (const Vector3& force : forces)
    total += force;
  return total;
}

} // namespace

TEST_CASE("A body that has followed its cut is in balance and equals the body built anew") {
  // A window that would hold most of a body holds all of it.
  const bool whole = GENERATE(true, false);
  Scene scene(-Scene::depth, whole ? 0.02 : 0.06);
  GrowthOptions options = scene.options();
  std::vector<Vector3> candidates; // on the top, ahead of the cut and far from it
  for (int i = 0; i < scene.nodes.size() && candidates.size() < 6; ++i)
    if (scene.nodes.kinds[i] == NodeKind::surface && scene.nodes.normals[i].z() > 0.9 &&
        scene.nodes.positions[i].x() > 0.01) {
      options.contact.push_back(i);
      candidates.push_back(scene.nodes.positions[i]);
    }
  REQUIRE(candidates.size() == 6);
  GrowingBody body(scene.problem(), options);
  for (int increment = 0; increment < 3; ++increment) {
    const SprinkleIncrement change = scene.grow();
    const BodyGrowth growth = body.grow(change, scene.problem());
    INFO(growth.uncovered << growth.update.reason);
    REQUIRE(std::string(growth.uncovered).empty());
    CHECK_FALSE(growth.update.condensed_anew);
    REQUIRE(body.problem().nodes.positions == scene.nodes.positions);
    CHECK((body.system().window_unknowns() == body.report().unknowns) == whole);
    const Field field = body.solve();
    CHECK(body.residual(field, {}, {}) < 1e-10);
    CHECK(body.report().unknowns == 3 * scene.nodes.size());

    // The dense system from scratch on the same cells, and the ordinary body, whose cells are finer at the new front.
    const GrowingCut::Scratch scratch = body.system().from_scratch({});
    CHECK((body.system().coefficients({}) - scratch.coefficients).norm() < 1e-9 * scratch.coefficients.norm());
    DiscretisationOptions method = scene.options().method;
    const auto ordinary = discretise(scene.problem(), method);
    const Field expected = ordinary->solve();
    CHECK((field.coefficients - expected.coefficients).norm() < 0.01 * expected.coefficients.norm());
    const Vector3 inside(0.013, -0.011, -0.012);
    CHECK((body.at(inside, field).displacement - ordinary->at(inside, expected).displacement).norm() <
          0.005 * ordinary->at(inside, expected).displacement.norm());
    CHECK((body.nodal_displacements(field) - ordinary->nodal_displacements(field)).norm() <
          1e-12 * body.nodal_displacements(field).norm());
    // Means over the shares of lips, those that earlier increments have left among them.
    std::vector<int> lips;
    for (int i = 0; i < scene.nodes.size(); ++i)
      if (scene.nodes.kinds[i] == NodeKind::lip)
        lips.push_back(i);
    const MatrixX means = ordinary->contact_displacements(lips, {field});
    CHECK((body.contact_displacements(lips, {field}) - means).norm() < 1e-12 * means.norm());

    // Forces on a lip, a surface node of the window or far from it.
    for (const int node :
         {scene.first(NodeKind::lip), scene.first(NodeKind::surface), scene.first(NodeKind::edge), 0}) {
      if (scene.nodes.kinds[node] == NodeKind::interior || scene.nodes.positions[node].z() < -0.029)
        continue;
      const std::vector<Field> responses = body.force_responses({node});
      for (int axis = 0; axis < 3; ++axis) {
        CHECK(body.residual(responses[axis], {node}, {Vector3::Unit(axis)}) < 1e-9);
        CHECK(body.residual(responses[axis], {}, {}) > 1e-3);
        CHECK((sum_of(body.constraint_forces(responses[axis])) + Vector3::Unit(axis)).norm() < 1e-8);
      }
      CHECK((body.contact_point(node) - ordinary->contact_point(node)).norm() < 1e-15);
    }

    // The compliance of a patch, of candidates that the system knows and of others, without the fields; and of a body
    // built at once. Lips that meet on a patch without fields.
    std::vector<int> patch_nodes{scene.first(NodeKind::lip)};
    for (const Vector3& x : candidates)
      patch_nodes.push_back(static_cast<int>(std::find(scene.nodes.positions.begin(), scene.nodes.positions.end(), x) -
                                             scene.nodes.positions.begin()));
    REQUIRE(*std::max_element(patch_nodes.begin(), patch_nodes.end()) < scene.nodes.size());
    const std::vector<LipPair> pairs = lip_pairs(body.problem().nodes);
    for (const Discretisation* each : std::vector<const Discretisation*>{&body, ordinary.get()}) {
      const ContactPatch full = condense(*each, patch_nodes);
      ContactPatch bare = condense_without_fields(*each, patch_nodes);
      CHECK((bare.compliance - full.compliance).norm() < 1e-9 * full.compliance.norm());
      ContactState pulled;
      for (std::size_t c = 0; c < patch_nodes.size(); ++c)
        pulled.nodal_forces.emplace_back(0.01 * static_cast<double>(c % 3), -0.02, 0.03);
      const Field with = deform(full, pulled);
      CHECK((deform(*each, bare, pulled).coefficients - with.coefficients).norm() < 1e-9 * with.coefficients.norm());
      CHECK_THROWS_AS(deform(bare, pulled), InputError);
      const MatrixX opened = condense_lips(*each, pairs, LipCondition::sticking, &full).lips_of_tool;
      CHECK((condense_lips(*each, pairs, LipCondition::sticking, &bare).lips_of_tool - opened).norm() <
            1e-9 * opened.norm());
      extend_responses(*each, 2, bare);
      CHECK(bare.responses.size() == std::min<std::size_t>(6, full.responses.size()));
      extend_responses(*each, 1000, bare);
      REQUIRE(bare.responses.size() == full.responses.size());
      CHECK((deform(bare, pulled).coefficients - with.coefficients).norm() < 1e-9 * with.coefficients.norm());
    }

    // Cases of forces on lips and far from the window, what they do to each other and to nodes: without fields as with.
    std::vector<int> forced{scene.first(NodeKind::surface), scene.first(NodeKind::edge)};
    for (const LipPair& pair : pairs)
      forced.insert(forced.end(), {pair.plus, pair.minus});
    MatrixX forces(3 * std::ssize(forced), 4);
    for (Eigen::Index k = 0; k < forces.size(); ++k)
      forces.data()[k] = std::sin(1.7 * static_cast<double>(k));
    forces.leftCols<2>().topRows<6>().setZero(); // these act on lips alone
    const CaseResponses cases = body.condense_cases(forced, forces, patch_nodes);
    const CaseResponses by_fields = body.Discretisation::condense_cases(forced, forces, patch_nodes);
    CHECK(cases.fields.empty());
    REQUIRE(by_fields.fields.size() == 4);
    CHECK((cases.among - by_fields.among).norm() < 1e-9 * by_fields.among.norm());
    CHECK((cases.at - by_fields.at).norm() < 1e-9 * by_fields.at.norm());
    CHECK_THROWS_AS(body.condense_cases(forced, forces, {scene.nodes.size()}), InputError);

    // Tool and lips together, in one solution and superposed.
    const ContactPatch full = condense(body, patch_nodes);
    ContactPatch bare = condense_without_fields(body, patch_nodes);
    LipPatch lips_met = condense_lips(body, pairs, LipCondition::sticking, &bare);
    CHECK(lips_met.responses.empty());
    CutContactState state;
    for (std::size_t c = 0; c < patch_nodes.size(); ++c)
      state.tool.nodal_forces.emplace_back(0.02, 0.01 * static_cast<double>(c % 3), -0.03);
    state.lips.forces = VectorX::LinSpaced(lips_met.compliance.cols(), -0.01, 0.02);
    const Field together = deform(body, bare, lips_met, state);
    CHECK_THROWS_AS(deform(full, lips_met, state), InputError);
    CutContactState open = state; // no forces: as without lips
    open.lips.forces.resize(0);
    CHECK((deform(body, bare, lips_met, open).coefficients - deform(body, bare, state.tool).coefficients).norm() == 0);
    open.lips.forces = VectorX::Zero(1);
    CHECK_THROWS_AS(deform(body, bare, lips_met, open), InputError);
    extend_responses(body, 1, lips_met);
    CHECK(std::ssize(lips_met.responses) == lips_met.modes);
    CHECK_FALSE(has_fields(lips_met));
    extend_responses(body, 1000, lips_met);
    REQUIRE(std::ssize(lips_met.responses) == lips_met.compliance.cols());
    const Field superposed = deform(full, lips_met, state);
    CHECK((together.coefficients - superposed.coefficients).norm() < 1e-9 * superposed.coefficients.norm());
    bare.nodes.pop_back();
    lips_met.responses.clear();
    CHECK_THROWS_AS(deform(body, bare, lips_met, state), InputError); // another patch's
    std::vector<Vector3> moved(scene.problem().prescribed.size(), Vector3(1, 2, 3));
    const Field rigid = body.prescribed_response(moved);
    CHECK((body.at(inside, rigid).displacement - Vector3(1, 2, 3)).norm() < 1e-8);
  }
}

TEST_CASE("A spread force on a followed body does as much work as the point force it is near to") {
  Scene scene;
  GrowingBody body(scene.problem(), scene.options());
  const SprinkleIncrement change = scene.grow();
  static_cast<void>(body.grow(change, scene.problem()));
  const ForcePattern a{{{0.01, 0.002, -0.01}, {0.012, 0.001, -0.011}}, {{0.5, 0, 0.2}, {0.5, 0.1, 0}}};
  const ForcePattern b{{{-0.01, -0.01, -0.005}}, {{0, 0, -1}}};
  const std::vector<Field> responses = body.pattern_responses({a, b});
  const MatrixX conjugate = body.pattern_displacements({a, b}, responses);
  CHECK(conjugate(0, 1) == Approx(conjugate(1, 0)).epsilon(1e-9)); // Betti
  const Vector3 u = body.at(b.points[0], responses[1]).displacement;
  CHECK(conjugate(1, 1) == Approx(-u.z()).epsilon(1e-12));
}

TEST_CASE("A piece that comes free is not covered, and the body stays what it was") {
  Scene scene(-0.034); // through the whole height
  Problem problem = scene.problem();
  // Held at one end alone, the other half of the block comes free when the blade has passed.
  const auto at_end = [](const Vector3& x) { return x.y() > 0.02 - 1e-9; };
  const auto held_end = [&] {
    Problem p = scene.problem();
    p.prescribed.clear();
    for (int i = 0; i < p.nodes.size(); ++i)
      if ((p.nodes.kinds[i] == NodeKind::surface || p.nodes.kinds[i] == NodeKind::edge) && at_end(p.nodes.positions[i]))
        p.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    p.prescribed_region = [](const Vector3& x, const Vector3& normal) { return normal.y() > 0.5 && x.y() > 0.019; };
    return p;
  };
  GrowingBody body(held_end(), scene.options());
  VectorX before = body.solve().coefficients;
  bool freed = false;
  for (int k = 0; k < 12 && !freed; ++k) {
    const SprinkleIncrement change = scene.grow();
    const BodyGrowth growth = body.grow(change, held_end(), [&] { return scene.options().way; });
    freed = std::string(growth.uncovered) == "a piece came free";
    if (!freed) {
      CHECK(body.residual(body.solve(), {}, {}) < 1e-8);
      before = body.solve().coefficients;
    }
  }
  CHECK(freed);
  CHECK(body.solve().coefficients == before);
}

TEST_CASE("A followed body refuses a change that does not fit its nodes") {
  Scene scene;
  GrowingBody body(scene.problem(), scene.options());
  Problem same = scene.problem();
  SprinkleIncrement change;
  change.removed = {scene.nodes.size()};
  CHECK_THROWS_AS(body.grow(change, same), InputError);
  change.removed = {1};
  CHECK_THROWS_WITH(body.grow(change, same), Catch::Contains("stay"));
}
