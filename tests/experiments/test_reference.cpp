#include "experiments/analytic/half_space.hpp"
#include "experiments/hemisphere_palpation/palpation.hpp"
#include "experiments/hemisphere_palpation/reference.hpp"
#include "experiments/reference/axisymmetric.hpp"
#include "experiments/support/plane_slits.hpp"

#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::experiments;
using solvers::Material;
using std::numbers::pi;

namespace {

bool on_border(const AxisymmetricGrid& grid, int i, int j) {
  return i == 0 || j == 0 || i == grid.rows - 1 || j == grid.columns - 1;
}

std::vector<double> evenly(double from, double to, int n) {
  return graded_interval(from, to, n, 1);
}

void hold(std::vector<AxisymmetricSupport>& supports, int node, const Vector2& value) {
  supports.push_back({node, 0, value.x()});
  supports.push_back({node, 1, value.y()});
}

} // namespace

TEST_CASE("Axisymmetric elements reproduce linear fields on a distorted grid") {
  const AxisymmetricGrid grid = make_grid(evenly(0, 1, 4), evenly(0, 2, 5), [](double s, double t) {
    const double bulge = 0.15 * std::sin(pi * s) * std::sin(pi * t / 2);
    return Vector2(s + bulge, t - bulge);
  });
  const auto exact = [](const Vector2& x) { return Vector2(0.3 * x.x(), -0.7 * x.y() + 0.2); };
  std::vector<AxisymmetricSupport> supports;
  for (int i = 0; i < grid.rows; ++i)
    for (int j = 0; j < grid.columns; ++j)
      if (on_border(grid, i, j))
        hold(supports, grid.node(i, j), exact(grid.nodes[grid.node(i, j)]));
  for (double nu : {0.0, 0.3, 0.45}) {
    const AxisymmetricSolution solution = solve_axisymmetric(grid, Material{2, nu, 0}, supports);
    for (std::size_t k = 0; k < grid.nodes.size(); ++k)
      CHECK((solution.displacement[k] - exact(grid.nodes[k])).norm() < 1e-12);
  }
}

TEST_CASE("A stretched cylinder thins by Poisson's ratio under the force of Young's modulus") {
  const double radius = 0.4, length = 1.5, strain = 0.01;
  const Material material{7, 0.35, 0};
  const AxisymmetricGrid grid =
      make_grid(evenly(0, length, 3), evenly(0, radius, 2), [](double z, double r) { return Vector2(r, z); });
  std::vector<AxisymmetricSupport> supports;
  for (int j = 0; j < grid.columns; ++j) {
    supports.push_back({grid.node(0, j), 1, 0});
    supports.push_back({grid.node(grid.rows - 1, j), 1, strain * length});
  }
  const AxisymmetricSolution solution = solve_axisymmetric(grid, material, supports);
  double pull = 0, base = 0;
  for (int j = 0; j < grid.columns; ++j) {
    pull += solution.reaction[grid.node(grid.rows - 1, j)].y();
    base += solution.reaction[grid.node(0, j)].y();
  }
  CHECK(pull == Approx(7 * strain * pi * radius * radius).epsilon(1e-10));
  CHECK(base == Approx(-pull).epsilon(1e-10));
  CHECK(solution.displacement[grid.node(3, grid.columns - 1)].x() == Approx(-0.35 * strain * radius).epsilon(1e-10));
}

TEST_CASE("A thick sphere swells as Lame found, with an error of third order") {
  // u_R = A R + B / R^2; sigma_RR = (3 lambda + 2 mu) A - 4 mu B / R^3.
  const double inner = 0.5, A = -0.1, B = 0.1;
  for (double nu : {0.0, 0.3, 0.45}) {
    const Material material{1, nu, 0};
    std::vector<double> errors;
    for (const int n : {6, 12}) {
      const AxisymmetricGrid grid = make_grid(evenly(inner, 1, n), evenly(0, pi / 2, n), [](double R, double t) {
        return Vector2(t == 0 ? 0 : R * std::sin(t), t == pi / 2 ? 0 : R * std::cos(t));
      });
      const auto exact = [&](const Vector2& x) { return Vector2(x * (A + B / std::pow(x.norm(), 3))); };
      std::vector<AxisymmetricSupport> supports;
      for (int j = 0; j < grid.columns; ++j)
        for (const int k : {grid.node(0, j), grid.node(grid.rows - 1, j)})
          hold(supports, k, exact(grid.nodes[k]));
      for (int i = 0; i < grid.rows; ++i)
        supports.push_back({grid.node(i, grid.columns - 1), 1, 0}); // plane of symmetry
      const AxisymmetricSolution solution = solve_axisymmetric(grid, material, supports);
      double error = 0;
      for (std::size_t k = 0; k < grid.nodes.size(); ++k)
        error = std::max(error, (solution.displacement[k] - exact(grid.nodes[k])).norm());
      errors.push_back(error);
      // On the half sphere the radial stress adds up to sigma times the area of the opening. The node on the rim
      // carries stress of the plane of symmetry too and is left out.
      double push = 0;
      for (int j = 0; j < grid.columns - 1; ++j)
        push -= solution.reaction[grid.node(0, j)].y();
      const double lambda = material.lame_lambda(), mu = material.shear_modulus();
      const double stress = (3 * lambda + 2 * mu) * A - 4 * mu * B / std::pow(inner, 3);
      CHECK(push == Approx(stress * pi * inner * inner).epsilon(0.01));
    }
    CHECK(errors[1] < 2e-5 * 0.35); // relative to the displacement of the inner surface
    CHECK(errors[1] < errors[0] / 7);
  }
}

TEST_CASE("A bonded punch on a large block has the force of Mossakovskii's solution") {
  // Radius 1 on a block of radius and height 1000: truncation stiffens it by about one part in a thousand.
  const double far = 1000;
  for (double nu : {0.0, 0.3, 0.45}) {
    std::vector<double> radii = graded_interval(1, 0, 12, 4);
    std::ranges::reverse(radii);
    for (const double r : graded_interval(1, 2, 10, 4))
      if (r > 1)
        radii.push_back(r);
    for (int k = 1; k <= 18; ++k)
      radii.push_back(2 * std::pow(far / 2, k / 18.0));
    std::vector<double> depths = graded_interval(0, 1, 14, 4);
    for (int k = 1; k <= 20; ++k)
      depths.push_back(std::pow(far, k / 20.0));
    const AxisymmetricGrid grid = make_grid(depths, radii, [](double z, double r) { return Vector2(r, -z); });
    std::vector<AxisymmetricSupport> supports;
    for (int j = 0; j < grid.columns; ++j) {
      hold(supports, grid.node(grid.rows - 1, j), Vector2::Zero());
      if (grid.nodes[grid.node(0, j)].x() <= 1)
        hold(supports, grid.node(0, j), Vector2(0, -1));
    }
    for (int i = 0; i < grid.rows; ++i)
      hold(supports, grid.node(i, grid.columns - 1), Vector2::Zero());
    const Material material{1, nu, 0};
    const AxisymmetricSolution solution = solve_axisymmetric(grid, material, supports);
    double force = 0;
    for (int j = 0; j < grid.columns; ++j)
      if (grid.nodes[grid.node(0, j)].x() <= 1)
        force -= solution.reaction[grid.node(0, j)].y();
    CHECK(force / (bonded_punch_factor(nu) * flat_punch_force(material, 1, 1)) == Approx(1.001).epsilon(0.0015));
  }
}

TEST_CASE("Axisymmetric problems that cannot be solved are refused") {
  const auto straight = [](double z, double r) { return Vector2(r, z); };
  const AxisymmetricGrid grid = make_grid(evenly(0, 1, 2), evenly(0, 1, 2), straight);
  const Material material{1, 0.3, 0};
  CHECK_THROWS_AS(solve_axisymmetric(grid, material, {}), NumericalError); // free to move along the axis
  CHECK_THROWS_AS(solve_axisymmetric(grid, material, {{99, 0, 0}}), InputError);
  CHECK_THROWS_AS(solve_axisymmetric(grid, Material{1, 0.5, 0}, {{0, 1, 0}}), InputError);
  AxisymmetricGrid folded = grid;
  std::swap(folded.nodes[6], folded.nodes[8]);
  CHECK_THROWS_AS(solve_axisymmetric(folded, material, {{0, 1, 0}}), NumericalError);
  AxisymmetricGrid short_of_nodes = grid;
  short_of_nodes.nodes.pop_back();
  CHECK_THROWS_AS(solve_axisymmetric(short_of_nodes, material, {{0, 1, 0}}), InputError);
}

TEST_CASE("The axisymmetric hemisphere converges to under half a percent in force and surface displacement") {
  const HemisphereReference reference = axisymmetric_hemisphere(0.3);
  CHECK(reference.force_change < 1e-3);
  CHECK(reference.surface_change < 1e-3);
  const HemisphereReference loose = axisymmetric_hemisphere(0.3, 5e-3);
  CHECK(std::abs(loose.force / reference.force - 1) < 5e-3);
  CHECK(largest_difference(loose, reference) < 5e-3);
  // Boundary values: cap pushed down by 1, rim fixed, and the force above that of a half-space.
  CHECK(reference.displacement(0.1) == Vector2(0, -1));
  CHECK(reference.displacement(pi / 2) == Vector2(0, 0));
  CHECK(reference.force > bonded_punch_factor(0.3) * flat_punch_force(Material{1, 0.3, 0}, 0.25, 1));
  CHECK(reference.force < 0.8);
  const Vector3 turned = reference.displacement(Vector3(-0.6, 0, 0.8));
  CHECK(turned.x() == Approx(-reference.displacement(std::asin(0.6)).x()));
  CHECK(turned.z() == Approx(reference.displacement(std::asin(0.6)).y()));
  CHECK_THROWS_AS(reference.displacement(-0.1), InputError);
  CHECK_THROWS_AS(axisymmetric_hemisphere(0.48), InputError);
}

TEST_CASE("GetFEM's bricks and the axisymmetric elements agree on the hemisphere within half a percent") {
  for (double nu : {0.3, 0.45}) {
    const HemisphereReference bricks = load_hemisphere_reference(nu), revolved = axisymmetric_hemisphere(nu);
    CHECK(bricks.poisson_ratio == nu);
    CHECK(bricks.force_change < 5e-3);
    CHECK(bricks.surface_change < 5e-3);
    CHECK(std::abs(bricks.force / revolved.force - 1) < 5e-3);
    CHECK(largest_difference(bricks, revolved) < 5e-3);
    CHECK(largest_difference(revolved, bricks) < 5e-3);
    CHECK(bricks.angle.size() % 2 == 1);
    CHECK(bricks.displacement(0.2) == Vector2(0, -1));
  }
  CHECK_THROWS_WITH(load_hemisphere_reference(0.2), Catch::Contains("0.3, 0.45"));
}

TEST_CASE(
    "A surface that no sphere covers stands still for the paper's local nodes and is an error for a whole organ") {
  HemispherePalpation run = palpate_with_pattern(0.3, 0.3);
  const double far = 0.5 * pi - 0.01;
  CHECK(surface_displacement(run, far).norm() == 0);
  CHECK(surface_displacement(run, 0.01).norm() > 0.1);
  run.local_nodes = false;
  CHECK_THROWS_AS(surface_displacement(run, far), InputError);
}

TEST_CASE("Tables of slits in a plate are read, and refused when something is missing") {
  const std::string head = "# made by: hand\n# tension: 0 1\n# poisson_ratio: 0.3\n# slit_0: 0 0 0.5 0\n"
                           "# calculix_change: 1e-3\n# getfem_change: 2e-3\n",
                    rest = "# codes_apart: 1e-5\nslit,part,share,calculix_x,calculix_y,getfem_x,getfem_y\n";
  const experiments::PlaneSlits plate = experiments::read_plane_slits(head + rest + "0,0,0.25,0.1,0.2,0.11,0.21\n");
  CHECK(plate.tension == Eigen::Vector2d(0, 1));
  CHECK(plate.mesh_change == 2e-3);
  REQUIRE(plate.slits.size() == 1);
  CHECK(plate.slits[0][1] == Eigen::Vector2d(0.5, 0));
  REQUIRE(plate.places.size() == 1);
  CHECK(plate.places[0].share == 0.25);
  CHECK(plate.places[0].opening == Eigen::Vector2d(0.1, 0.2));
  CHECK_THROWS_AS(experiments::read_plane_slits(head), InputError);
  CHECK_THROWS_AS(experiments::read_plane_slits(head + rest + "0,0,0.25,0.1\n"), InputError);
  CHECK_THROWS_AS(experiments::read_plane_slits(head + rest + "0,1,0.25,0.1,0.2,0.11,0.21\n"), InputError);
  CHECK_THROWS_AS(experiments::read_plane_slits(head + rest + "0,0,x,0.1,0.2,0.11,0.21\n"), InputError);
}
