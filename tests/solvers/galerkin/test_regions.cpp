// Bodies of several materials by the weak form.
#include "solvers/body/discretisation.hpp"
#include "solvers/elasticity/law.hpp"
#include "solvers/finite/body.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "tests/support/bodies.hpp"

#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

std::shared_ptr<const MaterialRegions> one_region(std::vector<RegionFace> faces, const Material& material) {
  return std::make_shared<const MaterialRegions>(std::vector<MaterialRegion>{{"part", std::move(faces), material}});
}

/// The whole surface of the box held at a field.
void hold_everywhere(Problem& problem, const std::function<Vector3(const Vector3&)>& field) {
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != NodeKind::interior)
      problem.prescribed.push_back({i, {true, true, true}, field(problem.nodes.positions[i])});
  problem.prescribed_region = [](const Vector3&, const Vector3&) { return true; };
  problem.prescribed_field = field;
}

/// The surface of the unit cube held at a field along its normals.
void hold_along_normals(Problem& problem, const std::function<Vector3(const Vector3&)>& field) {
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (const Vector3& x = problem.nodes.positions[i]; x[axis] < 1e-9 || x[axis] > 1 - 1e-9) {
        std::array<bool, 3> along{};
        along[axis] = true;
        problem.prescribed.push_back({i, along, field(x)});
      }
  problem.prescribed_region = [](const Vector3&, const Vector3& normal, int axis) {
    return std::abs(normal[axis]) > 0.5;
  };
  problem.prescribed_field = field;
}

double error_at_nodes(const Discretisation& body, const std::function<Vector3(const Vector3&)>& field) {
  const VectorX u = body.nodal_displacements(body.solve());
  double error = 0, size = 0;
  for (int i = 0; i < body.problem().nodes.size(); ++i) {
    const Vector3 exact = field(body.problem().nodes.positions[i]);
    error += (u.segment<3>(3 * i) - exact).squaredNorm();
    size += exact.squaredNorm();
  }
  return std::sqrt(error / size);
}

double p_wave_modulus(const Material& material) {
  return material.lame_lambda() + 2 * material.shear_modulus();
}

} // namespace

TEST_CASE("Two layers in confined compression deform as the exact solution, at contrasts up to 1000") {
  for (const double contrast : {0.001, 10.0, 1000.0})
    for (const double face : {0.5, 0.43}) {
      CAPTURE(contrast, face);
      Problem problem = held_box(Vector3::Zero(), Vector3::Ones(), 1.0 / 6, 0.25, {1, 0.3, 0});
      const Material top{contrast, 0.2, 0};
      problem.regions = one_region(half_space_faces({-Vector3::UnitZ(), -face}), top);
      const double below = 1 / p_wave_modulus(problem.material), above = 1 / p_wave_modulus(top);
      const double stress = -0.01 / (below * face + above * (1 - face));
      const auto exact = [&](const Vector3& x) -> Vector3 {
        return stress * (below * std::min(x.z(), face) + above * std::max(x.z() - face, 0.0)) * Vector3::UnitZ();
      };
      hold_along_normals(problem, exact);
      const auto body = discretise(std::move(problem), {});
      CHECK(error_at_nodes(*body, exact) < 0.006);
      const Field field = body->solve();
      double force = 0;
      const std::vector<Vector3> forces = body->constraint_forces(field);
      for (std::size_t k = 0; k < forces.size(); ++k)
        if (body->problem().nodes.positions[body->problem().prescribed[k].node].z() < 1e-9 &&
            body->problem().prescribed[k].components[2])
          force += forces[k].z();
      CHECK(force == Approx(-stress).epsilon(0.01));
    }
}

TEST_CASE("A stiff ball in a soft body swells as the exact solution") {
  // u = A r inside, B r + C / r^2 outside; displacement and radial stress are continuous at the radius.
  const Material soft{1, 0.3, 0}, stiff{100, 0.3, 0};
  const double radius = 0.31;
  const auto bulk = [](const Material& m) { return 3 * m.lame_lambda() + 2 * m.shear_modulus(); };
  const double c_over_b = (bulk(soft) - bulk(stiff)) / (bulk(stiff) + 4 * soft.shear_modulus());
  const auto exact = [&](const Vector3& x) -> Vector3 {
    const Vector3 arm = x - Vector3::Constant(0.5);
    const double r = arm.norm();
    return 0.01 * (r < radius ? 1 + c_over_b : 1 + c_over_b * std::pow(radius / r, 3)) * arm;
  };
  double before = 0;
  for (const double h : {1.0 / 6, 1.0 / 10}) {
    Problem problem = held_box(Vector3::Zero(), Vector3::Ones(), h, 0.2, soft);
    problem.regions = one_region(ball_faces(Vector3::Constant(0.5), radius), stiff);
    hold_everywhere(problem, exact);
    const auto body = discretise(std::move(problem), {});
    const double error = error_at_nodes(*body, exact);
    CAPTURE(h, error);
    CHECK(error < (before > 0 ? 0.6 * before : 0.03));
    before = error;
  }
}

TEST_CASE("Stress at a point is that of its region, with the initial strain there") {
  Problem problem = held_box(Vector3::Zero(), Vector3::Ones(), 0.25, 0.2, {1, 0, 0});
  problem.regions = one_region(half_space_faces({-Vector3::UnitZ(), -0.5}), {4, 0, 0});
  hold_everywhere(problem, [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  problem.loads.initial_strain.diagonal() = Vector3(-0.02, -0.02, 0);
  const auto body = discretise(std::move(problem), {});
  const Field field = body->solve();
  CHECK(field.coefficients.lpNorm<Eigen::Infinity>() < 1e-3); // stress along the layers is in balance
  for (const double z : {0.2, 0.8}) {
    const Material& material = body->problem().material_at({0.5, 0.5, z});
    CHECK(body->at({0.5, 0.5, z}, field).stress(0, 0) == Approx(0.02 * material.young_modulus).epsilon(0.05));
  }
}

TEST_CASE("A region of the material that is elsewhere alters little") {
  Problem problem = held_box(Vector3::Zero(), Vector3::Ones(), 0.125, 0.2, {1, 0.4, 0});
  const auto bent = [](const Vector3& x) -> Vector3 { return 0.01 * Vector3(x.x() * x.z(), 0, -0.5 * x.x() * x.x()); };
  hold_everywhere(problem, bent);
  const auto displacements = [](const Problem& of) {
    const auto body = discretise(of, {});
    return body->nodal_displacements(body->solve());
  };
  const VectorX plain = displacements(problem);
  problem.regions = one_region(box_faces({0.2, 0.2, 0.2}, {0.83, 0.8, 0.8}), {1, 0.4, 0});
  const VectorX parted = displacements(problem);
  CHECK((parted - plain).norm() < 0.01 * plain.norm());
}

TEST_CASE("Points of cells at a face lie on their side of it and share out the volume of each region") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.2);
  const Problem box = held_box(Vector3::Zero(), Vector3::Ones(), 0.2, 0.2, {1, 0.3, 0});
  const auto share = [&](std::vector<RegionFace> faces, bool is_in_box = true) {
    BackgroundOptions options{0.75, 2};
    options.regions = one_region(std::move(faces), {2, 0.3, 0});
    const BackgroundCells cells = background_cells(*domain, box.nodes, options);
    double inside = 0, whole = 0;
    for (const QuadraturePoint& point : cells.points) {
      whole += point.weight;
      inside += options.regions->at(point.position) == 0 ? point.weight : 0;
    }
    CHECK(whole == Approx(1).epsilon(is_in_box ? 1e-9 : 1e-2));
    for (std::size_t c = 0; c + 1 < cells.start.size(); ++c)
      CHECK(cells.of(static_cast<int>(c)).size() <= most_cell_points);
    return inside;
  };
  CHECK(share(half_space_faces({Vector3::UnitX(), 0.377})) == Approx(0.377).epsilon(1e-6));
  CHECK(share(slab_faces({Vector3::UnitY(), 0.6}, 0.11)) == Approx(0.11).epsilon(0.02));
  CHECK(share(box_faces({0.2, 0.3, 0.4}, {0.5, 0.71, 0.9})) == Approx(0.3 * 0.41 * 0.5).epsilon(0.03));
  CHECK(share(ball_faces(Vector3::Constant(0.5), 0.3)) == Approx(4.0 / 3 * std::numbers::pi * 0.027).epsilon(0.02));
  CHECK(share(depth_faces(domain, 0, 0.1)) == Approx(1 - 0.512).epsilon(0.03));
}

TEST_CASE("Regions that overlap or hold no point, and what takes one material alone, are refused by name") {
  const Problem plain = held_box(Vector3::Zero(), Vector3::Ones(), 0.25, 0.2, {1, 0.3, 0});
  const auto refused = [&](std::vector<MaterialRegion> regions) {
    Problem problem = plain;
    problem.regions = std::make_shared<const MaterialRegions>(std::move(regions));
    return discretise(std::move(problem), {});
  };
  const Material material{2, 0.3, 0};
  CHECK_THROWS_WITH(refused({{"one", ball_faces(Vector3::Constant(0.5), 0.3), material},
                             {"two", box_faces(Vector3::Zero(), Vector3::Constant(0.5)), material}}),
                    Contains("'one' and 'two' overlap"));
  CHECK_THROWS_WITH(refused({{"far", ball_faces({3, 0, 0}, 0.3), material}}), Contains("'far' holds none of the"));
  CHECK_THROWS_WITH(refused({{"dot", ball_faces({0.51, 0.53, 0.49}, 1e-4), material}}), Contains("too small"));
  CHECK_THROWS_WITH(refused({{"soft", half_space_faces({}), {0, 0.3, 0}}}), Contains("'soft'") && Contains("0 Pa"));
  CHECK_THROWS_AS(MaterialRegions({}), InputError);
  CHECK_THROWS_AS(MaterialRegions({{"none", {}, material}}), InputError);

  Problem problem = plain;
  problem.regions = one_region(half_space_faces({Vector3::UnitZ(), 0.5}), material);
  for (const Method method : {Method::collocation, Method::published}) {
    DiscretisationOptions options;
    options.method = method;
    CHECK_THROWS_WITH(discretise(problem, options), Contains(std::string(to_string(method))) && Contains("'part'"));
  }
  CHECK_THROWS_WITH(FiniteBody(problem, make_law({NeoHookeanLaw{1}, 10, {}})), Contains("finite strain"));
}
