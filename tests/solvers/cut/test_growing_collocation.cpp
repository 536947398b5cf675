#include "solvers/collocation/collocation.hpp"
#include "solvers/contact/lip_contact.hpp"
#include "solvers/contact/solver.hpp"
#include "solvers/cut/growing_body.hpp"
#include "tests/solvers/growing_scene.hpp"
#include "topology/base/errors.hpp"
#include "topology/cells/voronoi_cells.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

struct CollocationScene : tests::GrowingScene {
  explicit CollocationScene(double nu, double lower = -depth, double half_width = 0.02)
      : GrowingScene(lower, half_width, Method::collocation) {
    poisson_ratio = nu;
  }
};

Growable& growable(Discretisation& body) {
  return dynamic_cast<Growable&>(body);
}

double largest_difference(const SparseMatrix& a, const SparseMatrix& b) {
  return SparseMatrix(a - b).coeffs().cwiseAbs().maxCoeff() / a.coeffs().cwiseAbs().maxCoeff();
}

std::vector<int> patch_of(const CollocationScene& scene) { // ahead of the cut, and a lip
  std::vector<int> patch;
  for (int i = 0; i < scene.nodes.size() && patch.size() < 5; ++i)
    if (scene.nodes.kinds[i] == NodeKind::surface && scene.nodes.normals[i].z() > 0.9 &&
        scene.nodes.positions[i].x() > 0.008)
      patch.push_back(i);
  return patch;
}

} // namespace

TEST_CASE("Balance rows that have followed a cut are those of a body built anew, and so are its fields") {
  for (const double nu : {0.3, 0.46}) {
    CollocationScene scene(nu, -CollocationScene::depth, 0.09);
    GrowthOptions options = scene.options();
    options.contact = patch_of(scene);
    const auto body = make_growable(scene.problem(), options);
    for (int increment = 0; increment < 2; ++increment) {
      const SprinkleIncrement change = scene.grow();
      const BodyGrowth growth = growable(*body).grow(change, scene.problem(), [&] { return scene.options().way; });
      INFO("nu " << nu << ", increment " << increment << ": " << growth.uncovered << growth.update.reason);
      REQUIRE(std::string(growth.uncovered).empty());
      CHECK_FALSE(growth.update.condensed_anew);
      REQUIRE(body->problem().nodes.positions == scene.nodes.positions);
      CHECK(growth.update.boxes < growth.update.window_nodes);
      CHECK(growth.update.window_nodes < scene.nodes.size());

      const auto anew = discretise(scene.problem(), options.method);
      const CellBalance kept = cell_balance_of(*body), made = cell_balance_of(*anew);
      CHECK(largest_difference(made.rows, kept.rows) < 1e-12);
      const Field field = body->solve(), expected = anew->solve();
      CHECK((field.coefficients - expected.coefficients).norm() < 1e-10 * expected.coefficients.norm());
      if (nu > 0.4)
        CHECK((field.pressure - expected.pressure).norm() < 1e-9 * expected.pressure.norm());
      CHECK(body->residual(field, {}, {}) < 1e-10);
      CHECK(body->load_work(field) == Approx(anew->load_work(expected)).epsilon(1e-9));

      const std::vector<int> patch = patch_of(scene);
      const MatrixX compliance = anew->contact_compliance(patch);
      CHECK((body->contact_compliance(patch) - compliance).norm() < 1e-9 * compliance.norm());
      std::vector<int> mixed{scene.first(NodeKind::lip), patch.front(), 0};
      const MatrixX of_all = anew->contact_compliance(mixed);
      CHECK((body->contact_compliance(mixed) - of_all).norm() < 1e-9 * of_all.norm());
      const std::vector<Vector3> forces{{0, 0.01, -0.02}, {0.003, 0, 0.01}, {0, 0, -0.001}};
      const Field pulled = body->force_response(mixed, forces);
      CHECK((pulled.coefficients - anew->force_response(mixed, forces).coefficients).norm() <
            1e-9 * pulled.coefficients.norm());
      // Lips that meet beside a tool, on a patch with fields and without.
      const std::vector<LipPair> pairs = lip_pairs(scene.nodes);
      const ContactPatch full = condense(*anew, patch), bare = condense_without_fields(*body, patch);
      const LipPatch lips = condense_lips(*body, pairs, LipCondition::sticking, &bare);
      const LipPatch wanted = condense_lips(*anew, pairs, LipCondition::sticking, &full);
      CHECK((lips.compliance - wanted.compliance).norm() < 1e-8 * wanted.compliance.norm());
      CHECK((lips.tool_of_lips - wanted.tool_of_lips).norm() < 1e-8 * wanted.tool_of_lips.norm());
      CHECK((lips.lips_of_tool - wanted.lips_of_tool).norm() < 1e-8 * wanted.lips_of_tool.norm());
      const std::vector<Vector3> moved(scene.problem().prescribed.size(), Vector3(1, 2, 3));
      const Vector3 inside(0.013, -0.011, -0.012);
      CHECK((body->at(inside, body->prescribed_response(moved)).displacement - Vector3(1, 2, 3)).norm() < 1e-7);
    }
  }
}

TEST_CASE("An update of the balance that the window does not cover is declined, or condensed anew") {
  CollocationScene scene(0.3);
  GrowthOptions options = scene.options();
  options.way = topology::make_rectangle_sheet({0.02, 0.015, -0.02}, Vector3::UnitX(), Vector3::UnitZ(), 0.004, 0.004,
                                               0.002); // where the blade does not go
  const auto body = make_growable(scene.problem(), options);
  const VectorX before = body->solve().coefficients;
  const SprinkleIncrement change = scene.grow();
  const BodyGrowth declined = growable(*body).grow(change, scene.problem(), {}, true);
  CHECK(declined.update.declined);
  CHECK_FALSE(std::string(declined.uncovered).empty());
  CHECK(body->solve().coefficients == before);
  const BodyGrowth growth = growable(*body).grow(change, scene.problem(), [&] { return scene.options().way; });
  CHECK(std::string(growth.uncovered).empty());
  CHECK(growth.update.condensed_anew);
  const VectorX expected = discretise(scene.problem(), options.method)->solve().coefficients;
  CHECK((body->solve().coefficients - expected).norm() < 1e-10 * expected.norm());
}

TEST_CASE("A load that throws leaves the body whose balance follows a cut as it was") {
  CollocationScene scene(0.3);
  const auto body = make_growable(scene.problem(), scene.options());
  const Field before = body->solve();
  const int count = scene.nodes.size();
  const SprinkleIncrement change = scene.grow();
  Problem grown = scene.problem();
  grown.loads.body_force = [](const Vector3& /*x*/) -> Vector3 { throw InputError("no force is known here"); };
  CHECK_THROWS_WITH(growable(*body).grow(change, grown, {}, false), Catch::Contains("no force is known"));
  REQUIRE(body->problem().nodes.size() == count);
  CHECK(body->solve().coefficients == before.coefficients);
  CHECK(body->residual(before, {}, {}) < 1e-10);
  const BodyGrowth growth = growable(*body).grow(change, scene.problem(), {}, true);
  CHECK(std::string(growth.uncovered).empty());
  const VectorX expected = discretise(scene.problem(), scene.options().method)->solve().coefficients;
  CHECK((body->solve().coefficients - expected).norm() < 1e-10 * expected.norm());
}

TEST_CASE("A body whose balance becomes singular with its cut is made again as it was") {
  CollocationScene scene(0.3);
  GrowthOptions options = scene.options();
  options.way = topology::make_rectangle_sheet({0, 0, -0.015}, Vector3::UnitY(), Vector3::UnitZ(), 0.06, 0.03, 0.004);
  options.contact = patch_of(scene);
  const auto body = make_growable(scene.problem(), options); // all of it in the window
  const std::vector<int> patch = patch_of(scene);
  const VectorX before = body->solve().coefficients;
  const MatrixX compliance = body->contact_compliance(patch);
  const SprinkleIncrement change = scene.grow();
  Problem loose = scene.problem(); // held along x alone
  for (Prescribed& entry : loose.prescribed)
    entry.components = {true, false, false};
  CHECK_THROWS_AS(growable(*body).grow(change, loose, {}, true), NumericalError);
  CHECK((body->solve().coefficients - before).norm() < 1e-10 * before.norm());
  CHECK((body->contact_compliance(patch) - compliance).norm() < 1e-9 * compliance.norm());
  const BodyGrowth growth = growable(*body).grow(change, scene.problem(), {}, true);
  CHECK(std::string(growth.uncovered).empty());
  CHECK_FALSE(growth.update.condensed_anew);
  const VectorX expected = discretise(scene.problem(), options.method)->solve().coefficients;
  CHECK((body->solve().coefficients - expected).norm() < 1e-10 * expected.norm());
}

TEST_CASE("A piece that comes free is not covered by an update of the balance either") {
  CollocationScene scene(0.3, -0.034); // through the whole height
  const auto held_end = [&] {
    Problem p = scene.problem();
    p.prescribed.clear();
    for (int i = 0; i < p.nodes.size(); ++i)
      if ((p.nodes.kinds[i] == NodeKind::surface || p.nodes.kinds[i] == NodeKind::edge) &&
          p.nodes.positions[i].y() > 0.02 - 1e-9)
        p.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    return p;
  };
  const auto body = make_growable(held_end(), scene.options());
  VectorX before = body->solve().coefficients;
  bool freed = false;
  for (int k = 0; k < 12 && !freed; ++k) {
    const SprinkleIncrement change = scene.grow();
    const BodyGrowth growth = growable(*body).grow(change, held_end(), [&] { return scene.options().way; });
    freed = std::string(growth.uncovered) == "a piece came free";
    if (!freed) {
      CHECK(body->residual(body->solve(), {}, {}) < 1e-8);
      before = body->solve().coefficients;
    }
  }
  CHECK(freed);
  CHECK(body->solve().coefficients == before);
}

TEST_CASE("What cannot follow its cut by an update is refused") {
  CollocationScene scene(0.3);
  GrowthOptions options = scene.options();
  options.way = {};
  CHECK_THROWS_WITH(make_growable(scene.problem(), options), Catch::Contains("way of the cut is empty"));
  options = scene.options();
  options.contact = {scene.nodes.size()};
  CHECK_THROWS_WITH(make_growable(scene.problem(), options), Catch::Contains("does not exist"));
  options = scene.options();
  options.method.method = Method::published;
  CHECK_THROWS_AS(make_growable(scene.problem(), options), InputError);
  const auto body = make_growable(scene.problem(), scene.options());
  SprinkleIncrement change;
  change.removed = {1};
  CHECK_THROWS_WITH(growable(*body).grow(change, scene.problem(), {}, false), Catch::Contains("stay"));
}
