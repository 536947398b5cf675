// Problem:   a quarter of a block of 2 x 2 x 0.5, bonded on both large faces and compressed by 30 %, neo-Hookean,
// nearly
//            incompressible: where a pressure for every point locks.
// Reference: the same on finer nodes, the finest by the symmetry about the middle plane, too.
// Command:   spherecut experiment run finite_locking --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/finite_block.hpp"

#include "src/output/figure.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

struct Compression {
  int nodes = 0;
  double force = 0; // over the shear modulus, m2
  solvers::EquilibriumStatus status;
};

Compression compress_bonded(double nu, int divisions, bool half_height, double pointwise_modulus) {
  FiniteBlock block{.upper = {1, 1, half_height ? 0.25 : 0.5}, .spacing = 1.0 / divisions, .jitter = 0.2};
  block.held[0][0] = block.held[2][1] = true; // planes of symmetry
  block.held[5].fill(true);
  if (half_height)
    block.held[4][2] = true;
  else
    block.held[4].fill(true);
  solvers::FiniteOptions options;
  options.pointwise_modulus = pointwise_modulus;
  const solvers::FiniteBody body(finite_block(block), neo_hookean(1, nu), options);
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = 1e-4;
  if (nu > 0.49) // fewer and dearer iterations
    accurate.method = solvers::FiniteMethod::newton;
  solvers::Equilibrium equilibrium(body, accurate);
  constexpr int steps = 10;
  Compression result;
  const double top = block.upper.z();
  for (int k = 1; k <= steps; ++k) {
    const double depth = 0.3 * top * k / steps;
    result.status = equilibrium.solve(
        {body.prescribed_values([&](const Vector3& x) { return Vector3(0, 0, x.z() > top - 1e-9 ? -depth : 0); }),
         1,
         {}});
  }
  result.nodes = body.size();
  result.force = -face_force(body, equilibrium.constraint_forces(), 2, top).z();
  return result;
}

} // namespace

std::vector<Check> run_finite_locking(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table({"poisson_ratio", "pressure", "spacing", "nodes", "force", "least_jacobian"});
  app::Figure figure{"Bonded block compressed by 30 %", "spacing", "force over mu", false, false, {}};
  for (const double nu : context.quick ? std::vector<double>{0.49} : std::vector<double>{0.49, 0.499}) {
    app::Series of_blocks{fmt::format("pressure of blocks, nu = {}", nu), {}, {}};
    const auto run = [&](int divisions, bool half_height, bool blocks) {
      const double modulus =
          blocks ? solvers::FiniteOptions().pointwise_modulus : std::numeric_limits<double>::infinity();
      const Compression result = compress_bonded(nu, divisions, half_height, modulus);
      table.add({fmt::format("{}", nu), blocks ? "blocks" : "points", fmt::format("{:.4f}", 1.0 / divisions),
                 fmt::format("{}", result.nodes), fmt::format("{:.4f}", result.force),
                 fmt::format("{:.3f}", result.status.least_jacobian)});
      context.say(fmt::format("nu = {}, pressure of {}, spacing 1/{}, {} nodes: force {:.4f} mu m2, least J {:.3f}", nu,
                              blocks ? "blocks" : "points", divisions, result.nodes, result.force,
                              result.status.least_jacobian));
      if (blocks) {
        of_blocks.x.push_back(1.0 / divisions);
        of_blocks.y.push_back(result.force);
      }
      return result.force;
    };
    // The finest pair, by second order in the spacing.
    constexpr int fine = 12, finer = 16;
    const double force = run(8, false, true), locked = run(8, false, false);
    const double a = run(fine, true, true), b = run(finer, true, true);
    const double ratio = std::pow(static_cast<double>(finer) / fine, 2), converged = b + (b - a) / (ratio - 1);
    context.say(fmt::format("nu = {}: converged force {:.4f} mu m2", nu, converged));
    figure.series.push_back(of_blocks);
    checks.push_back({fmt::format("finite_locking_{}", nu), std::abs(force / converged - 1), "<=", 0.05});
    checks.push_back({fmt::format("finite_locking_points_{}_reported", nu), std::abs(locked / converged - 1), ">=", 0});
  }
  table.write(context.out / "forces.csv");
  app::write_png(figure, context.out / "forces.png");
  return checks;
}

} // namespace spherecut::experiments
