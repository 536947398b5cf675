// The force balance of cells beside a cut: exact fields, severed pieces, forces that balance, pre-tension.
#include "solvers/body/discretisation.hpp"
#include "tests/support/cut_sheets.hpp"
#include "topology/base/errors.hpp"
#include "topology/cells/voronoi_cells.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

struct CutBody {
  Problem problem;
  Vector3 normal, ahead, tangent; // of the sheet; it ends `ahead`
};

const Vector3 skew(0.17, -0.11, 1);

/// Block of 1 x 0.8 x 0.9 m with a flat sheet whose front is aligned with nothing. `reach` is where it ends along
/// `ahead`.
CutBody cut_body(double reach, double poisson_ratio, const Vector3& normal = skew) {
  constexpr double spacing = 0.2;
  CutBody body;
  body.normal = normal.normalized();
  body.ahead = Vector3(1, 0.13, 0).cross(body.normal).cross(body.normal).normalized() * -1;
  body.tangent = body.normal.cross(body.ahead);
  Problem& problem = body.problem;
  problem.domain = topology::make_box_domain(Vector3::Zero(), {1, 0.8, 0.9}, spacing);
  const Vector3 corner = Vector3(0.48, 0.41, 0.43) - 2 * body.ahead - 2 * body.tangent;
  problem.incision = std::make_shared<topology::Incision>(
      std::vector<topology::SurfaceMesh>{tests::flat_sheet(corner, (2 + reach) * body.ahead, 4 * body.tangent, 30, 30)},
      problem.domain);
  SprinkleOptions options;
  options.spacing.coarse = options.spacing.fine = spacing;
  options.ring_ahead = true;
  options.incision = problem.incision;
  problem.nodes = sprinkle(*problem.domain, options).nodes;
  problem.material.young_modulus = 3000;
  problem.material.poisson_ratio = poisson_ratio;
  return body;
}

/// Leaves out the single nodes so near to the sheet that their cells would meet across it in steps.
void clear_the_sheet(Problem& problem) {
  NodeCloud kept;
  const NodeCloud& nodes = problem.nodes;
  for (int i = 0; i < nodes.size(); ++i) {
    const auto face = problem.incision->closest(nodes.positions[i], 0.9 * nodes.spacings[i]);
    if (nodes.kinds[i] == NodeKind::lip || !face || face->on_border)
      kept.add(nodes, i);
  }
  problem.nodes = kept;
}

bool on_surface(const Problem& problem, int node) {
  return problem.domain->signed_distance(problem.nodes.positions[node]) > -1e-3 * problem.nodes.spacings[node];
}

/// Holds every node of the outer surface at `displacement`.
template <class Displacement>
void hold_surface(Problem& problem, const Displacement& displacement) {
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (on_surface(problem, i))
      problem.prescribed.push_back({i, {true, true, true}, displacement(problem.nodes.positions[i])});
}

DiscretisationOptions collocation(SightRule rule = SightRule::enriched) {
  DiscretisationOptions options;
  options.method = Method::collocation;
  options.sight = rule;
  return options;
}

Matrix3 stress_of(const Material& material, const Matrix3& strain) {
  return material.lame_lambda() * strain.trace() * Matrix3::Identity() + 2 * material.shear_modulus() * strain;
}

template <class Exact>
double largest_error(const Discretisation& body, const Field& field, const Exact& exact) {
  const VectorX u = body.nodal_displacements(field);
  double worst = 0;
  for (int i = 0; i < body.problem().nodes.size(); ++i)
    worst = std::max(worst, (u.segment<3>(3 * i) - exact(body.problem().nodes.positions[i])).norm());
  return worst;
}

} // namespace

TEST_CASE("Collocation with a cut: a uniform strain is exact when the lips carry its traction", "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::diffraction, SightRule::enriched);
  CutBody body = cut_body(0.04, poisson_ratio);
  Matrix3 gradient;
  gradient << 0.01, 0.004, -0.003, 0.002, -0.006, 0.005, 0.001, 0.003, 0.008;
  const auto exact = [&](const Vector3& x) -> Vector3 { return gradient * x; };
  const Matrix3 stress = stress_of(body.problem.material, 0.5 * (gradient + gradient.transpose()));
  // The surface needs it too: not every cell that reaches it belongs to a node that is held there.
  body.problem.loads.lip_traction =
      body.problem.loads.traction = [&](const Vector3&, const Vector3& normal) -> Vector3 { return stress * normal; };
  hold_surface(body.problem, exact);
  const auto discrete = discretise(body.problem, collocation(rule));
  const Field field = discrete->solve();
  INFO("nu " << poisson_ratio << ", " << to_string(rule));
  CHECK(largest_error(*discrete, field, exact) < 1e-11);
  CHECK(discrete->residual(field) < 1e-11);
  CHECK((discrete->at({0.5, 0.4, 0.2}, field).stress - stress).norm() < 1e-8 * stress.norm());
}

TEST_CASE("Collocation with a cut: tension along the sheet passes by traction-free lips", "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  // A sheet square to the walls: where it is not, the two lips of a rim meet at a slant there.
  CutBody body = cut_body(0.04, poisson_ratio, Vector3::UnitZ());
  clear_the_sheet(body.problem);
  const Vector3 t = (body.tangent + 0.4 * body.ahead).normalized();
  const Matrix3 strain =
      0.01 * ((1 + poisson_ratio) * t * t.transpose() - poisson_ratio * Matrix3::Identity()); // stress t t^T
  const auto exact = [&](const Vector3& x) -> Vector3 { return strain * x; };
  const Matrix3 stress = stress_of(body.problem.material, strain);
  REQUIRE((stress * body.normal).norm() < 1e-12 * stress.norm());
  body.problem.loads.traction = [&](const Vector3&, const Vector3& normal) -> Vector3 { return stress * normal; };
  hold_surface(body.problem, exact);
  const auto discrete = discretise(body.problem, collocation());
  CHECK(largest_error(*discrete, discrete->solve(), exact) < 1e-9);
}

TEST_CASE("Collocation with a cut: nothing passes between the halves of a severed block", "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::enriched);
  CutBody body = cut_body(2, poisson_ratio);
  Problem& problem = body.problem;
  const Vector3 centre(0.48, 0.41, 0.43);
  const auto above = [&](int i) { return (problem.nodes.positions[i] - centre).dot(body.normal) > 0; };
  const Vector3 turn(0.02, -0.03, 0.05), shift(0.1, 0.2, 0.3);
  const auto rigid = [&](const Vector3& x) -> Vector3 { return shift + turn.cross(x); };
  std::vector<int> pulled;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (const double z = problem.nodes.positions[i].z(); z > 0.9 - 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, rigid(problem.nodes.positions[i])});
    else if (z < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    else if (problem.nodes.kinds[i] == NodeKind::lip && above(i) && pulled.size() < 3)
      pulled.push_back(i);
  REQUIRE(pulled.size() == 3);
  const auto discrete = discretise(problem, collocation(rule));
  const VectorX u = discrete->nodal_displacements(discrete->solve());
  double upper = 0, lower = 0, response = 0;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (above(i))
      upper = std::max(upper, (u.segment<3>(3 * i) - rigid(problem.nodes.positions[i])).norm());
    else
      lower = std::max(lower, u.segment<3>(3 * i).cwiseAbs().maxCoeff());
  CHECK(upper < 1e-12);
  CHECK(lower == 0.0);
  for (const Field& field : discrete->force_responses(pulled))
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (!above(i))
        response = std::max(response, field.coefficients.segment<3>(3 * i).cwiseAbs().maxCoeff());
  CHECK(response == 0.0);
}

TEST_CASE("Collocation with a cut: a piece that nothing holds is refused, held or dropped", "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  CutBody body = cut_body(2, poisson_ratio);
  Problem& problem = body.problem;
  problem.loads.body_force = [](const Vector3& x) -> Vector3 { return {0, 0, x.z() < 0.43 ? -30.0 : 0.0}; };
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.positions[i].z() < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  DiscretisationOptions options = collocation();
  CHECK_THROWS_AS(discretise(problem, options), InputError);

  options.unheld = UnheldPieces::drop;
  const auto dropped = discretise(problem, options);
  const std::vector<Piece>& pieces = dropped->report().pieces;
  REQUIRE(pieces.size() == 2);
  REQUIRE(pieces[0].held != pieces[1].held);
  const Piece &loose = pieces[0].held ? pieces[1] : pieces[0], &fixed = pieces[0].held ? pieces[0] : pieces[1];
  CHECK(loose.centroid.z() > fixed.centroid.z());
  const VectorX left = dropped->nodal_displacements(dropped->solve());
  for (const int node : loose.nodes)
    CHECK(left.segment<3>(3 * node).cwiseAbs().maxCoeff() == 0.0);

  options.unheld = UnheldPieces::hold;
  const auto held = discretise(problem, options);
  const VectorX both = held->nodal_displacements(held->solve());
  double difference = 0;
  for (const int node : fixed.nodes)
    difference = std::max(difference, (both - left).segment<3>(3 * node).norm());
  CHECK(left.norm() > 1e-3);
  CHECK(difference < 1e-12);
}

TEST_CASE("Collocation with a cut: pressure opens it and its forces cancel", "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  CutBody body = cut_body(0.04, poisson_ratio);
  Problem& problem = body.problem;
  problem.loads.lip_traction = [](const Vector3&, const Vector3& normal) -> Vector3 { return -20 * normal; };
  hold_surface(problem, [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  const auto discrete = discretise(problem, collocation());
  const Field field = discrete->solve();
  const VectorX u = discrete->nodal_displacements(field);
  Vector3 total = Vector3::Zero();
  double largest = 0;
  for (const Vector3& force : discrete->constraint_forces(field)) {
    total += force;
    largest = std::max(largest, force.norm());
  }
  CHECK(largest > 0.1);
  CHECK(total.norm() < 1e-10 * largest);
  CHECK(discrete->residual(field) < 1e-11);
  const std::vector<int> partner = lip_partners(problem.nodes);
  int inside = 0;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (partner[i] >= 0 && !on_surface(problem, i)) {
      ++inside;
      CHECK((u.segment<3>(3 * i) - u.segment<3>(3 * partner[i])).dot(problem.nodes.normals[i]) < 0);
    }
  CHECK(inside > 10);
}

TEST_CASE("Collocation with a cut: pre-tension opens it as the traction that it takes from the lips would",
          "[collocation][cut]") {
  const double poisson_ratio = GENERATE(0.3, 0.49);
  CutBody body = cut_body(0.04, poisson_ratio);
  Problem& problem = body.problem;
  hold_surface(problem, [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  Matrix3 initial;
  initial << -0.01, 0.002, 0, 0.002, -0.02, 0.001, 0, 0.001, -0.015;
  problem.loads.initial_strain = initial;
  const auto tense = discretise(problem, collocation());
  const VectorX gape = tense->nodal_displacements(tense->solve());

  const Matrix3 stress = stress_of(problem.material, initial);
  problem.loads.initial_strain.setZero();
  problem.loads.lip_traction =
      problem.loads.traction = [&](const Vector3&, const Vector3& normal) -> Vector3 { return stress * normal; };
  const auto loaded = discretise(problem, collocation());
  const VectorX opened = loaded->nodal_displacements(loaded->solve());
  CHECK(opened.norm() > 1e-3);
  CHECK((gape - opened).norm() < 1e-9 * opened.norm());
}

TEST_CASE("Cells beside a cut: their lips end at the front whatever the nodes ahead of it", "[collocation][cut]") {
  CutBody body = cut_body(0.04, 0.3);
  const Problem& problem = body.problem;
  const double left_out = GENERATE(0, 0.8); // in spacings: nodes so near ahead of the front are taken away
  NodeCloud nodes;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    const auto front = problem.incision->front_frame(x, left_out * problem.nodes.spacings[i] + 1e-9);
    if (!front || (x - front->point).dot(front->ahead) < 0)
      nodes.add(x, problem.nodes.spacings[i], problem.nodes.kinds[i], problem.nodes.normals[i]);
  }
  const topology::CellComplex cells =
      topology::voronoi_cells(nodes.positions, nodes.spacings, *problem.domain, problem.incision.get());
  double ahead = 0, joined = 0;
  for (std::size_t k = 0; k < cells.lip_corners.size(); ++k)
    if (const auto front = problem.incision->front_frame(cells.lip_corners[k], 1))
      ahead = std::max(ahead, (cells.lip_corners[k] - front->point).dot(front->ahead));
  for (const topology::CellFace& face : cells.faces)
    if ((nodes.positions[face.first] - nodes.positions[face.second]).norm() < 0.01 * nodes.spacings[face.first])
      joined += face.area.norm();
  CHECK(ahead < 0.01 * nodes.spacings[0]);
  if (left_out > 0)
    CHECK(joined > 0.05 * problem.incision->front_length() * nodes.spacings[0]);
  double volume = 0;
  for (const double v : cells.volumes)
    volume += v;
  CHECK(volume == Approx(0.72).epsilon(1e-9));
}
