#include "solvers/body/elastic_body.hpp"
#include "solvers/body/surface_patches.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "solvers/quadrature/split_box.hpp"
#include "topology/base/errors.hpp"

#include "tests/support/cut_block.hpp"
#include "tests/support/cut_sheets.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

double side_of(const CutBlock& block, const Vector3& x) {
  return (x - block.frame.origin).dot(block.frame.normal);
}

bool at_z(const Vector3& x, double z) {
  return std::abs(x.z() - z) < 1e-9;
}

void hold_face(Problem& problem, double z, const Vector3& value) {
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (at_z(problem.nodes.positions[i], z))
      problem.prescribed.push_back({i, {true, true, true}, value});
}

} // namespace

TEST_CASE("A box split by a plane keeps volume and first moment, and each part is what sampling says",
          "[cut_galerkin]") {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  const Vector3 centre(0.3, -1, 2), half(0.5, 0.3, 0.7);
  for (int trial = 0; trial < 20; ++trial) {
    const Vector3 n = Vector3(normal(random), normal(random), trial % 5 == 0 ? 0 : normal(random)).normalized();
    const Vector3 p = centre + 0.3 * half.cwiseProduct(Vector3(normal(random), normal(random), normal(random)));
    const auto parts = split_box(centre, half, p, n);
    const double whole = 8 * half.prod();
    CHECK(parts[0].volume + parts[1].volume == Approx(whole).epsilon(1e-13));
    CHECK((parts[0].volume * parts[0].centroid + parts[1].volume * parts[1].centroid - whole * centre).norm() < 1e-12);
    const int m = 40;
    double volume = 0;
    Vector3 moment = Vector3::Zero();
    for (int a = 0; a < m; ++a)
      for (int b = 0; b < m; ++b)
        for (int c = 0; c < m; ++c) {
          const Vector3 x = centre + half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1) / m - Vector3::Ones());
          if (n.dot(x - p) >= 0) {
            volume += whole / (m * m * m);
            moment += whole / (m * m * m) * x;
          }
        }
    CHECK(parts[0].volume == Approx(volume).margin(5e-3 * whole));
    CHECK((parts[0].volume * parts[0].centroid - moment).norm() < 1e-2 * whole);
  }
}

TEST_CASE("Background cells split by a cut keep the volume, and no cell of a severed body has both sides",
          "[cut_galerkin]") {
  const bool through = GENERATE(false, true);
  const CutBlock block = cut_block(8, through, 1);
  const BackgroundCells cells = background_cells(*block.domain, block.nodes, {0.75, 2}, block.incision.get());
  double volume = 0, above = 0;
  Vector3 moment_above = Vector3::Zero();
  int mixed = 0, largest = 0;
  for (std::size_t c = 0; c + 1 < cells.start.size(); ++c) {
    bool plus = false, minus = false;
    for (int q = cells.start[c]; q < cells.start[c + 1]; ++q) {
      const QuadraturePoint& point = cells.points[q];
      volume += point.weight;
      const bool positive = side_of(block, point.position) > 0;
      (positive ? plus : minus) = true;
      if (positive) {
        above += point.weight;
        moment_above += point.weight * point.position;
      }
    }
    mixed += plus && minus ? 1 : 0;
    largest = std::max(largest, cells.start[c + 1] - cells.start[c]);
  }
  CHECK(volume == Approx(1).epsilon(1e-12));
  CHECK(largest <= most_cell_points);
  if (through) {
    const auto parts = split_box(Vector3::Zero(), Vector3::Constant(0.5), block.frame.origin, block.frame.normal);
    CHECK(mixed == 0);
    CHECK(above == Approx(parts[0].volume).epsilon(1e-10));
    CHECK((moment_above - parts[0].volume * parts[0].centroid).norm() < 1e-10);
  }
}

TEST_CASE("Around a front what goes with 1 / r is integrated by one point a part", "[cut_galerkin]") {
  const CutBlock block = cut_block(8, false, 2);
  const auto nearness = [&](const Vector3& x) { return 1 / block.incision->front_frame(x, 2)->distance; };
  constexpr int lattice = 100;
  double sampled = 0;
  for (int a = 0; a < lattice; ++a)
    for (int b = 0; b < lattice; ++b)
      for (int c = 0; c < lattice; ++c)
        sampled += nearness((Vector3(a, b, c).array() + 0.5) / lattice - 0.5) / (lattice * lattice * lattice);
  const auto integrated = [&](bool enriched) {
    double sum = 0;
    for (const QuadraturePoint& point :
         background_cells(*block.domain, block.nodes, {0.75, 2, enriched}, block.incision.get()).points)
      sum += point.weight * nearness(point.position);
    return sum;
  };
  CHECK(integrated(true) == Approx(sampled).epsilon(1.5e-3));
  CHECK(integrated(false) < 0.995 * sampled); // at the centroids
}

TEST_CASE("Bodies that are cut, or will be, take smaller spheres", "[cut_galerkin]") {
  const CutBlock block = cut_block(4, false, 1);
  Problem cut = problem_of(block, {1, 0.3, 0}), whole = cut;
  whole.incision = nullptr;
  CHECK(galerkin_support_radius(whole, {}) == 2);
  CHECK(galerkin_support_radius(whole, {.cut_ahead = true}) == 1.75);
  CHECK(galerkin_support_radius(cut, {}) == 1.75);
  CHECK(galerkin_support_radius(cut, {.support_radius = 1.9}) == 1.9);
  cut.material.poisson_ratio = 0.45;
  CHECK(galerkin_support_radius(cut, {}) == 2.2);
}

TEST_CASE("Both faces of a cut are integrated as far as they lie in the body", "[cut_galerkin]") {
  const CutBlock block = cut_block(8, false, 1);
  double area = 0, plus = 0;
  for (const SurfacePoint& point : lip_quadrature(*block.incision, block.nodes)) {
    area += point.weight;
    CHECK(block.domain->signed_distance(point.position) < 1e-4);
    CHECK(std::abs(side_of(block, point.position)) == Approx(lip_offset / 8).epsilon(1e-6));
    CHECK(side_of(block, point.position) * point.normal.dot(block.frame.normal) < 0);
    plus += side_of(block, point.position) > 0 ? point.weight : 0;
  }
  CHECK(plus == Approx(area / 2).epsilon(1e-12));
  CHECK(area == Approx(2 * block.incision->area()).epsilon(2e-3));
}

TEST_CASE("Narrow strips of a curved cut are integrated together: area vector exact, points on the faces, few",
          "[cut_galerkin]") {
  // A quarter of a cylinder of radius 0.4 about x, whose front is the edge at 90 degrees, in 80 strips.
  // Or a washboard of ridges of 30 degrees, far finer than a group.
  const bool ridged = GENERATE(false, true);
  const topology::SurfaceMesh sheet = mapped_sheet(24, 80, [ridged](double s, double t) {
    const double turn = 0.5 * std::numbers::pi * t, ridge = std::lround(80 * t) % 2 == 0 ? 0.0 : 0.00453;
    return ridged ? Vector3(0.6 * s - 0.3, 0.628 * t - 0.3, ridge)
                  : Vector3(0.6 * s - 0.3, 0.4 * std::sin(turn), 0.4 * std::cos(turn) - 0.2);
  });
  const auto field = [](const Vector3& x) { return std::exp(x.x()) * std::cos(2 * x.y()); };
  Vector3 area_vector = Vector3::Zero();
  double area = 0, integral = 0;
  for (const Triangle& t : sheet.triangles) {
    const Vector3 &a = sheet.vertices[t[0]], &b = sheet.vertices[t[1]], &c = sheet.vertices[t[2]];
    const Vector3 part = 0.5 * (b - a).cross(c - a);
    area_vector += part;
    area += part.norm();
    integral += part.norm() * field((a + b + c) / 3);
  }
  const auto domain = topology::make_box_domain(Vector3::Constant(-0.5), Vector3::Constant(0.5), 0.05);
  const topology::Incision incision({sheet}, domain);
  NodeCloud nodes;
  const double spacing = GENERATE(0.1, 0.2);
  for (double x = -0.5; x <= 0.5; x += spacing)
    for (double y = -0.5; y <= 0.5; y += spacing)
      for (double z = -0.5; z <= 0.5; z += spacing)
        nodes.add({x, y, z}, spacing, NodeKind::interior, Vector3::Zero());
  const std::vector<SurfacePoint> points = lip_quadrature(incision, nodes);
  Vector3 found_vector = Vector3::Zero();
  double found_area = 0, found_integral = 0;
  for (const SurfacePoint& point : points) {
    const auto face = incision.closest(point.position, spacing);
    REQUIRE(face);
    CHECK(face->distance == Approx(lip_offset * spacing).epsilon(0.02));
    const double side = face->normal.dot(point.position - face->point);
    CHECK(side * face->normal.dot(point.normal) < 0); // out of the material on this side
    found_vector += side > 0 ? Vector3(-point.weight * point.normal) : Vector3(point.weight * point.normal);
    found_area += point.weight;
    found_integral += point.weight * field(point.position);
  }
  CHECK((found_vector / 2 - area_vector).norm() < 1e-12 * area);
  CHECK(found_area / 2 == Approx(area).epsilon(0.01));
  CHECK(found_integral / 2 == Approx(integral).epsilon(0.01));
  CHECK(points.size() < sheet.triangles.size()); // two faces of them
}

TEST_CASE("A linear field with its tractions on the faces of the cut passes the patch test", "[cut_galerkin]") {
  // By sight alone the shape functions jump ahead of the front: a longer crack, as far as the patch can tell.
  const auto [rule, bound] = GENERATE(table<SightRule, double>(
      {{SightRule::visibility, 0.6}, {SightRule::diffraction, 0.015}, {SightRule::enriched, 0.02}}));
  const CutBlock block = cut_block(8, false, 2);
  Problem problem = problem_of(block, {1, 0.3, 0});
  Matrix3 slope;
  slope << 0.4, -0.3, 0.2, 0.5, 0.1, -0.6, -0.2, 0.7, 0.3;
  const Matrix3 stress = stress_from_gradient(problem.material, slope);
  problem.loads.traction =
      problem.loads.lip_traction = [stress](const Vector3&, const Vector3& n) -> Vector3 { return stress * n; };
  problem.prescribed_field = [slope](const Vector3& x) -> Vector3 { return slope * x; };
  problem.prescribed_region = [](const Vector3& x, const Vector3& n) { return at_z(x, -0.5) && n.z() < -0.5; };
  hold_face(problem, -0.5, Vector3::Zero());
  DiscretisationOptions options;
  options.sight = rule;
  const auto body = discretise(problem, options);
  const VectorX u = body->nodal_displacements(body->solve());
  double error = 0, size = 0;
  for (int i = 0; i < block.nodes.size(); ++i) {
    const Vector3 exact = slope * block.nodes.positions[i];
    error += (u.segment<3>(3 * i) - exact).squaredNorm();
    size += exact.squaredNorm();
  }
  CHECK(body->report().pieces.size() == 1);
  CHECK(std::sqrt(error / size) < bound);
}

TEST_CASE("A severed body: no coupling, one half moves as a rigid body and the other not at all", "[cut_galerkin]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::enriched);
  const CutBlock block = cut_block(6, true, 3);
  Problem problem = problem_of(block, {1, 0.3, 0});
  const auto rigid = [](const Vector3& x) -> Vector3 {
    return Vector3(0.1, -0.2, 0.3) + Vector3(0.4, 0.1, -0.5).cross(x);
  };
  hold_face(problem, -0.5, Vector3::Zero());
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (at_z(problem.nodes.positions[i], 0.5))
      problem.prescribed.push_back({i, {true, true, true}, rigid(problem.nodes.positions[i])});
  DiscretisationOptions options;
  options.sight = rule;
  const auto body = discretise(problem, options);
  REQUIRE(body->report().pieces.size() == 2);
  CHECK(body->report().pieces[0].held);
  CHECK(body->report().pieces[1].held);

  const OrderedStiffness stiffness = stiffness_of(*body);
  double coupling = 0;
  int entries = 0;
  for (int column = 0; column < stiffness.lower.outerSize(); ++column)
    for (SparseMatrix::InnerIterator entry(stiffness.lower, column); entry; ++entry) {
      const double a = side_of(block, block.nodes.positions[stiffness.order[entry.row() / 3]]);
      const double b = side_of(block, block.nodes.positions[stiffness.order[column / 3]]);
      if (a * b < 0) {
        coupling = std::max(coupling, std::abs(entry.value()));
        ++entries;
      }
    }
  CHECK(coupling == 0);
  CHECK(entries == 0);

  const VectorX u = body->nodal_displacements(body->solve());
  double moved = 0, still = 0;
  for (int i = 0; i < block.nodes.size(); ++i) {
    const Vector3& x = block.nodes.positions[i];
    if (side_of(block, x) > 0)
      moved = std::max(moved, (u.segment<3>(3 * i) - rigid(x)).norm());
    else
      still = std::max(still, u.segment<3>(3 * i).norm());
  }
  INFO("rigid error " << std::scientific << moved);
  CHECK(moved < 1e-12);
  CHECK(still == 0);
}

TEST_CASE("A piece that nothing holds has six free motions; it is refused by name, held softly or dropped",
          "[cut_galerkin]") {
  const CutBlock block = cut_block(5, true, 3);
  Problem problem = problem_of(block, {1, 0.3, 0});
  hold_face(problem, -0.5, Vector3::Zero());
  // A pull on the lower half's free face and a load in balance on the upper one.
  const double bottom = 1e-3;
  problem.loads.traction = [](const Vector3& x, const Vector3& n) -> Vector3 {
    return std::abs(n.x()) > 0.5 ? Vector3(n.x(), 0.2 * x.z(), 0) : Vector3::Zero();
  };
  DiscretisationOptions options;
  CHECK_THROWS_AS(discretise(problem, options), InputError);
  CHECK_THROWS_WITH(discretise(problem, options), Catch::Contains("nothing holds the one of"));

  options.unheld = UnheldPieces::hold;
  const auto held = discretise(problem, options);
  const auto& pieces = held->report().pieces;
  REQUIRE(pieces.size() == 2);
  const Piece& loose = pieces[0].held ? pieces[1] : pieces[0];
  CHECK_FALSE(loose.held);
  CHECK(loose.centroid.z() > bottom);

  const OrderedStiffness stiffness = stiffness_of(*held);
  std::vector<int> place(block.nodes.size(), -1);
  for (std::size_t k = 0; k < loose.nodes.size(); ++k)
    place[loose.nodes[k]] = static_cast<int>(k);
  MatrixX k_loose = MatrixX::Zero(3 * std::ssize(loose.nodes), 3 * std::ssize(loose.nodes));
  for (int column = 0; column < stiffness.lower.outerSize(); ++column)
    for (SparseMatrix::InnerIterator entry(stiffness.lower, column); entry; ++entry) {
      const int i = place[stiffness.order[entry.row() / 3]], j = place[stiffness.order[column / 3]];
      if (i >= 0 && j >= 0) {
        k_loose(3 * i + entry.row() % 3, 3 * j + column % 3) = entry.value();
        k_loose(3 * j + column % 3, 3 * i + entry.row() % 3) = entry.value();
      }
    }
  REQUIRE(stiffness.anchors.size() == 6);
  for (const Anchor& anchor : stiffness.anchors)
    k_loose.block<3, 3>(3 * place[anchor.node], 3 * place[anchor.node]) -=
        block.nodes.spacings[anchor.node] * anchor.direction * anchor.direction.transpose();
  const VectorX values = Eigen::SelfAdjointEigenSolver<MatrixX>(k_loose, Eigen::EigenvaluesOnly).eigenvalues();
  CHECK(std::abs(values[5]) < 1e-12 * values[values.size() - 1]);
  CHECK(values[6] > 1e-6 * values[values.size() - 1]);

  options.unheld = UnheldPieces::drop;
  const auto dropped = discretise(problem, options);
  const Field field = dropped->solve();
  CHECK(dropped->residual(field) < 1e-9);
  const VectorX u = dropped->nodal_displacements(field), u_held = held->nodal_displacements(held->solve());
  double lower = 0, largest_lower = 0, upper = 0;
  for (int i = 0; i < block.nodes.size(); ++i)
    if (place[i] >= 0) {
      upper = std::max(upper, u.segment<3>(3 * i).norm());
    } else {
      lower = std::max(lower, (u - u_held).segment<3>(3 * i).norm());
      largest_lower = std::max(largest_lower, u.segment<3>(3 * i).norm());
    }
  CHECK(upper == 0);
  CHECK(largest_lower > 1e-2);
  CHECK(lower < 1e-10 * largest_lower);
}

TEST_CASE("A piece held softly answers a load in balance exactly", "[cut_galerkin]") {
  const CutBlock block = cut_block(6, true, 5);
  Problem problem = problem_of(block, {1, 0.3, 0});
  hold_face(problem, -0.5, Vector3::Zero());
  Matrix3 stress;
  stress << 1, 0.2, 0, 0.2, -0.5, 0.3, 0, 0.3, 0.4;
  problem.loads.traction =
      problem.loads.lip_traction = [stress](const Vector3&, const Vector3& n) -> Vector3 { return stress * n; };
  DiscretisationOptions options;
  options.unheld = UnheldPieces::hold;
  const auto body = discretise(problem, options);
  const Field field = body->solve();
  double worst = 0;
  for (const Vector3& x : {Vector3(0.1, 0.1, 0.3), Vector3(-0.3, 0.2, 0.25), Vector3(0.3, -0.3, 0.4)})
    worst = std::max(worst, (body->at(x, field).stress - stress).norm());
  CHECK(worst < 0.05);
}

TEST_CASE("An initial strain that nothing resists becomes the strain of the body, without stress", "[cut_galerkin]") {
  const CutBlock block = cut_block(6, false, 6);
  Problem problem = problem_of(block, {1, 0.3, 0});
  Matrix3 strain;
  strain << 0.1, 0.02, 0, 0.02, -0.05, 0.03, 0, 0.03, 0.04;
  problem.loads.initial_strain = strain;
  problem.prescribed_field = [strain](const Vector3& x) -> Vector3 { return strain * x; };
  problem.prescribed_region = [](const Vector3& x, const Vector3& n) { return at_z(x, -0.5) && n.z() < -0.5; };
  hold_face(problem, -0.5, Vector3::Zero());
  const auto body = discretise(problem, {});
  const Field field = body->solve();
  for (const Vector3& x : {Vector3(0.1, 0.1, 0.3), Vector3(-0.3, 0.2, 0.25), Vector3(0.3, -0.3, -0.4)}) {
    const PointState state = body->at(x, field);
    CHECK((state.strain - strain).norm() < 2e-3 * strain.norm());
    CHECK(state.stress.norm() < 5e-3 * strain.norm());
  }
}

TEST_CASE("The share of a node on a face or beside the cut does not reach through it", "[cut_galerkin]") {
  const CutBlock block = cut_block(6, true, 7);
  const Spheres spheres(block.nodes.positions, block.nodes.spacings, 2.0, Basis::linear, 1e9,
                        {block.incision, SightRule::enriched});
  const SurfacePatches patches(*block.domain, block.nodes, block.incision);
  const SurfacePatches faces(*block.domain, block.nodes, block.incision, std::nullopt, SurfacePatches::Of::faces);
  double area = 0, face_area = 0;
  for (int i = 0; i < block.nodes.size(); ++i) {
    if (block.nodes.kinds[i] == NodeKind::interior)
      continue;
    const DisplacementMean mean = patches.mean(i, spheres);
    double sum = 0;
    for (std::size_t k = 0; k < mean.nodes.size(); ++k) {
      sum += mean.weights[k];
      CHECK(side_of(block, block.nodes.positions[mean.nodes[k]]) * side_of(block, block.nodes.positions[i]) > 0);
    }
    CHECK(sum == Approx(1).epsilon(1e-10));
    if (block.nodes.kinds[i] == NodeKind::lip) { // the faces alone give a lip node the same
      const DisplacementMean alone = faces.mean(i, spheres);
      CHECK((alone.nodes == mean.nodes && alone.weights == mean.weights && alone.area == mean.area));
    }
    (block.nodes.kinds[i] == NodeKind::lip ? face_area : area) += mean.area;
  }
  CHECK(area == Approx(6).epsilon(1e-6));
  CHECK(face_area == Approx(2 * block.incision->area()).epsilon(3e-3));
}
