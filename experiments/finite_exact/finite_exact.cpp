// Problem:   a block with irregular nodes at finite strain, neo-Hookean: stretched along one axis, confined, along two
// axes;
//            bent by 120 degrees.
// Reference: the closed forms of the law; the bent block of the same law (experiments/analytic/finite_strain.hpp).
// Command:   spherecut experiment run finite_exact --out DIR
#include "experiments/analytic/finite_strain.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/finite_block.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

struct StretchCase {
  std::string name;
  std::array<bool, 3> held; // axes whose stretch is given, by their high faces
  bool both;                // whether y is stretched as z is
  double end;               // stretch
};

/// Largest error of force and displacement on the way to the last stretch.
double stretch_error(const StretchCase& given, double nu, int divisions) {
  const auto law = neo_hookean(1, nu);
  FiniteBlock block{.spacing = 1.0 / divisions};
  for (int axis = 0; axis < 3; ++axis) {
    block.held[2 * axis][axis] = true;
    block.held[2 * axis + 1][axis] = given.held[axis];
  }
  const solvers::FiniteBody body(finite_block(block), law);
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = 1e-5;
  solvers::Equilibrium equilibrium(body, accurate);
  constexpr int steps = 10;
  double worst = 0;
  for (int k = 1; k <= steps; ++k) {
    const double stretch = 1 + (given.end - 1) * k / steps;
    const Vector3 all(1, given.both ? stretch : 1, stretch);
    equilibrium.solve(
        {body.prescribed_values([&](const Vector3& x) { return Vector3((all.array() - 1) * x.array()); }), 1, {}});
    const BlockState exact = block_state(*law, all, given.held);
    const double force = face_force(body, equilibrium.constraint_forces(), 2, 1).z();
    worst = std::max({worst, std::abs(force / exact.stress.z() - 1),
                      nodal_error(body, equilibrium.coefficients(),
                                  [&](const Vector3& x) { return Vector3((exact.stretch.array() - 1) * x.array()); })});
  }
  return worst;
}

struct BendingResult {
  int nodes = 0;
  double displacement = 0, moment = 0; // relative errors
  double iterations = 0;               // of a step, mean
};

BendingResult bend(double nu, int divisions) {
  const auto law = neo_hookean(1, nu);
  const double curvature = std::numbers::pi / 3, half = 0.5, depth = 2.0 / divisions;
  FiniteBlock block{.lower = {-half, -1, 0}, .upper = {half, 1, depth}, .spacing = 1.0 / divisions, .jitter = 0.2};
  block.held[2].fill(true);
  block.held[3].fill(true);
  block.held[4][2] = block.held[5][2] = true;
  const solvers::FiniteBody body(finite_block(block), law);
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = 1e-5;
  solvers::Equilibrium equilibrium(body, accurate);
  constexpr int steps = 20;
  BendingResult result;
  for (int k = 1; k <= steps; ++k) {
    const BentBlock exact(*law, half, curvature * k / steps);
    const auto status =
        equilibrium.solve({body.prescribed_values([&](const Vector3& x) { return exact.displacement(x); }), 1, {}});
    result.iterations += static_cast<double>(status.iterations) / steps;
  }
  const BentBlock exact(*law, half, curvature);
  const auto displacement = [&](const Vector3& x) { return exact.displacement(x); };
  double moment = 0;
  for (std::size_t e = 0; e < equilibrium.constraint_forces().size(); ++e) {
    const solvers::DisplacementMean& mean = body.held().means()[e];
    if (std::abs(mean.centroid.y() - 1) > 1e-9)
      continue;
    const Vector3 arm = mean.centroid + mean.of(displacement) + Vector3(1 / curvature, 0, 0);
    const Vector3& force = equilibrium.constraint_forces()[e];
    moment += (arm.x() * force.y() - arm.y() * force.x()) / depth;
  }
  result.nodes = body.size();
  result.displacement = nodal_error(body, equilibrium.coefficients(), displacement);
  result.moment = std::abs(moment / exact.moment() - 1);
  return result;
}

} // namespace

std::vector<Check> run_finite_exact(const ExperimentContext& context) {
  // Squeezed along two axes a neo-Hookean block does not stay homogeneous: its free face wrinkles at 0.666 [Biot 1963],
  // a block as thick as it is wide bulges before.
  const std::vector<StretchCase> cases = {
      {"uniaxial", {false, false, true}, false, 2},  {"uniaxial", {false, false, true}, false, 0.5},
      {"confined", {true, true, true}, false, 2},    {"confined", {true, true, true}, false, 0.5},
      {"equibiaxial", {false, true, true}, true, 2}, {"equibiaxial", {false, true, true}, true, 0.8}};
  std::vector<Check> checks;
  app::Table stretches({"case", "stretch", "poisson_ratio", "worst_error"});
  double worst = 0;
  for (const StretchCase& given : cases)
    for (const double nu : context.quick ? std::vector<double>{0.49} : std::vector<double>{0.3, 0.45, 0.49}) {
      const double error = stretch_error(given, nu, context.quick ? 3 : 5);
      worst = std::max(worst, error);
      stretches.add({given.name, fmt::format("{}", given.end), fmt::format("{}", nu), fmt::format("{:.1e}", error)});
      context.say(fmt::format("{} to {}, nu = {}: worst error {:.1e}", given.name, given.end, nu, error));
    }
  checks.push_back({"finite_stretch", worst, "<=", 0.003});
  stretches.write(context.out / "stretches.csv");

  app::Table bending({"poisson_ratio", "nodes", "displacement_error", "moment_error", "iterations_a_step"});
  app::Figure figure{"A block bent by 120 degrees", "spacing over thickness", "relative error", true, true, {}};
  const std::vector<int> sizes = context.quick ? std::vector<int>{4, 8} : std::vector<int>{4, 6, 8, 12};
  for (const double nu : context.quick ? std::vector<double>{0.49} : std::vector<double>{0.49, 0.499}) {
    std::vector<BendingResult> results;
    app::Series displacement{fmt::format("displacement, nu = {}", nu), {}, {}};
    app::Series moment{fmt::format("moment, nu = {}", nu), {}, {}};
    for (const int divisions : sizes) {
      const BendingResult& result = results.emplace_back(bend(nu, divisions));
      bending.add({fmt::format("{}", nu), fmt::format("{}", result.nodes), fmt::format("{:.2e}", result.displacement),
                   fmt::format("{:.2e}", result.moment), fmt::format("{:.1f}", result.iterations)});
      context.say(fmt::format("bent by 120 degrees, nu = {}, {} nodes: error of u {:.2e}, of the moment {:.2e}, {:.1f} "
                              "iterations a step",
                              nu, result.nodes, result.displacement, result.moment, result.iterations));
      displacement.x.push_back(1.0 / divisions);
      displacement.y.push_back(result.displacement);
      moment.x.push_back(1.0 / divisions);
      moment.y.push_back(result.moment);
      if (divisions == 8) { // 459 nodes
        checks.push_back({fmt::format("finite_bending_displacement_{}", nu), result.displacement, "<=", 0.02});
        checks.push_back({fmt::format("finite_bending_moment_{}", nu), result.moment, "<=", 0.02});
      }
    }
    figure.series.push_back(displacement);
    figure.series.push_back(moment);
    if (!context.quick)
      checks.push_back({fmt::format("finite_bending_slope_{}", nu),
                        std::log(results.front().displacement / results.back().displacement) /
                            std::log(static_cast<double>(sizes.back()) / sizes.front()),
                        ">=", 1.8});
  }
  bending.write(context.out / "bending.csv");
  app::write_png(figure, context.out / "bending.png");
  return checks;
}

} // namespace spherecut::experiments
