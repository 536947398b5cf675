// Problem:   unit cube with irregular nodes at finite strain, a constant deformation of 40 % stretch with shear:
// prescribed
//            on the whole surface, or on the base with the dead tractions P n on the five other faces.
// Reference: that deformation. Gradients that fit the quadrature reproduce it to what the iteration leaves.
// Command:   spherecut experiment run finite_patch --out DIR
#include "experiments/analytic/finite_strain.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/finite_block.hpp"

#include "src/output/figure.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double patch_tolerance = 1e-8;

/// A pull by 40 % away from the base whose sides would bear no stress, and a shear: dead loads that press on free sides
/// would make the state unstable.
Matrix3 stretch_with_shear(const solvers::Law& law) {
  Matrix3 gradient;
  const double across = block_state(law, {1, 1, 1.4}, {false, false, true}).stretch.x();
  gradient << across, 0.1, 0.3, 0, across, 0.1, 0, 0, 1.4;
  return gradient;
}

struct PatchResult {
  int nodes = 0;
  double gradient = 0, displacement = 0; // relative errors
};

PatchResult deform_patch(const std::shared_ptr<const solvers::Law>& law, int divisions, std::uint64_t seed, bool loaded,
                         bool consistent) {
  const Matrix3 gradient = stretch_with_shear(*law);
  FiniteBlock block{.spacing = 1.0 / divisions, .seed = seed};
  for (int face = 0; face < 6; ++face)
    block.held[face].fill(!loaded || face == 4);
  solvers::Problem problem = finite_block(block);
  constexpr int steps = 4;
  Matrix3 stress;
  double energy = 0;
  law->evaluate({&gradient, 1}, {}, {&energy, 1}, {&stress, 1});
  if (loaded)
    problem.loads.traction = [stress](const Vector3& x, const Vector3& normal) -> Vector3 {
      return x.z() < 1e-9 && normal.z() < -0.5 ? Vector3(Vector3::Zero()) : Vector3(stress * normal);
    };
  solvers::FiniteOptions options;
  options.consistent = consistent;
  const solvers::FiniteBody body(std::move(problem), law, options);
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = patch_tolerance;
  solvers::Equilibrium equilibrium(body, accurate);
  for (int k = 1; k <= steps; ++k) {
    const double part = static_cast<double>(k) / steps;
    const Matrix3 slope = part * (gradient - Matrix3::Identity());
    equilibrium.solve({body.prescribed_values([&](const Vector3& x) { return Vector3(slope * x); }), part, {}});
  }
  const VectorX& u = equilibrium.coefficients();
  return {body.size(), gradient_error(body, u, gradient),
          nodal_error(body, u, [&](const Vector3& x) { return Vector3((gradient - Matrix3::Identity()) * x); })};
}

/// Forces under a rotation by 90 degrees over those under the patch's deformation.
double forces_of_rotation(const std::shared_ptr<const solvers::Law>& law, int divisions) {
  FiniteBlock block{.spacing = 1.0 / divisions};
  block.held[4].fill(true);
  const solvers::FiniteBody body(finite_block(block), law);
  const Matrix3 turn =
      Eigen::AngleAxisd(std::numbers::pi / 2, Vector3(1, 2, 3).normalized()).toRotationMatrix() - Matrix3::Identity();
  const Matrix3 slope = stretch_with_shear(*law) - Matrix3::Identity();
  VectorX turned(3 * body.size()), stretched(3 * body.size());
  for (int i = 0; i < body.size(); ++i) {
    turned.segment<3>(3 * i) = turn * body.problem().nodes.positions[i];
    stretched.segment<3>(3 * i) = slope * body.problem().nodes.positions[i];
  }
  solvers::FiniteForces rotation, reference;
  body.evaluate(turned, rotation);
  body.evaluate(stretched, reference);
  return rotation.forces.norm() / reference.forces.norm();
}

} // namespace

std::vector<Check> run_finite_patch(const ExperimentContext& context) {
  const int divisions = context.quick ? 4 : 8, seeds = context.quick ? 1 : 3;
  const std::vector<double> ratios =
      context.quick ? std::vector<double>{0.49} : std::vector<double>{0.3, 0.45, 0.49, 0.499};
  std::vector<Check> checks;
  app::Table table({"surface", "gradients", "poisson_ratio", "nodes", "gradient_error", "displacement_error"});
  app::Figure figure{"Patch test at finite strain: 40 % stretch with shear",
                     "Poisson ratio",
                     "largest relative error of F",
                     false,
                     true,
                     {}};
  for (const bool loaded : {false, true})
    for (const bool consistent : {true, false}) {
      double worst = 0;
      app::Series series{std::string(loaded ? "base held, rest loaded" : "held") +
                             (consistent ? ", consistent" : ", as evaluated"),
                         {},
                         {}};
      for (const double nu : ratios) {
        PatchResult result;
        for (int seed = 1; seed <= (consistent ? seeds : 1); ++seed) {
          const PatchResult one = deform_patch(neo_hookean(1, nu), divisions, seed, loaded, consistent);
          result.nodes = one.nodes;
          result.gradient = std::max(result.gradient, one.gradient);
          result.displacement = std::max(result.displacement, one.displacement);
        }
        worst = std::max(worst, result.gradient);
        series.x.push_back(nu);
        series.y.push_back(result.gradient);
        const char* surface = loaded ? "base held, rest loaded" : "held";
        const char* gradients = consistent ? "consistent" : "as evaluated";
        table.add({surface, gradients, fmt::format("{}", nu), fmt::format("{}", result.nodes),
                   fmt::format("{:.1e}", result.gradient), fmt::format("{:.1e}", result.displacement)});
        context.say(fmt::format("surface {}, gradients {}, nu = {}: worst error of F {:.1e}, of u {:.1e}", surface,
                                gradients, nu, result.gradient, result.displacement));
      }
      figure.series.push_back(series);
      const std::string name = loaded ? "finite_patch_loaded" : "finite_patch_held";
      if (consistent)
        checks.push_back({name, worst, "<=", 1e-4});
      else
        checks.push_back({name + "_as_evaluated_reported", worst, ">=", 0});
    }
  const double turned = forces_of_rotation(neo_hookean(1, 0.49), divisions);
  context.say(fmt::format("rotation by 90 degrees: forces {:.1e} of those of the patch", turned));
  checks.push_back({"finite_rotation", turned, "<=", 1e-10});
  table.write(context.out / "errors.csv");
  app::write_png(figure, context.out / "errors.png");
  return checks;
}

} // namespace spherecut::experiments
