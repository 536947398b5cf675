// Problem:   unit cube with irregular nodes under a smooth manufactured field of four plane waves: base clamped to the
//            field, traction on the five other faces, body force inside.
// Reference: the field itself. Errors are relative L2 over the nodes; medians and worst of random node sets.
// Command:   spherecut experiment run smooth_convergence --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cube.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/stopwatch.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

using solvers::Method;

/// The bounds hold at 9 nodes a side, 729 in all.
constexpr int bound_divisions = 8;

struct Bound {
  Method method;
  double poisson_ratio;
  double error;
};

const std::vector<Bound> error_bounds = {{Method::collocation, 0.3, 0.02},   {Method::collocation, 0.45, 0.02},
                                         {Method::collocation, 0.49, 0.025}, {Method::galerkin, 0.3, 0.005},
                                         {Method::galerkin, 0.45, 0.025},    {Method::galerkin, 0.49, 0.025}};

/// Total force (N) that the discretisation applies for the problem's loads: what it takes to hold every node still.
Vector3 applied_force(solvers::Problem problem, const solvers::DiscretisationOptions& options) {
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_field = nullptr;
  problem.prescribed_region = nullptr;
  const auto body = solvers::discretise(std::move(problem), options);
  const solvers::Field still = body->solve();
  Vector3 sum = Vector3::Zero();
  for (const Vector3& force : body->constraint_forces(still))
    sum -= force;
  return sum;
}

} // namespace

std::vector<Check> run_smooth_convergence(const ExperimentContext& context) {
  const std::vector<int> divisions = context.quick ? std::vector<int>{4, 8} : std::vector<int>{4, 6, 8, 12};
  const int seeds = context.quick ? 2 : 10;
  const double jitter = 0.25;
  std::vector<Check> checks;
  app::Table table(
      {"method", "poisson_ratio", "divisions", "nodes", "median_error", "worst_error", "build_and_solve_ms"});
  app::Figure figure{
      "Smooth field: error against spacing, median of seeds", "spacing h / m", "relative L2 error", true, true, {}};

  double worst_row_balance = 0;
  const auto study = [&](Method method, double nu) {
    const ManufacturedField field = smooth_field({1, nu, 0});
    solvers::DiscretisationOptions options;
    options.method = method;
    app::Series series{fmt::format("{}, nu = {}", solvers::to_string(method), nu), {}, {}};
    double at_bound = 0, spread = 0;
    for (int n : divisions) {
      std::vector<double> errors, seconds;
      for (int seed = 1; seed <= seeds; ++seed) {
        solvers::Problem problem = cube_problem(field, n, jitter, seed);
        const Stopwatch stopwatch;
        const auto body = solvers::discretise(std::move(problem), options);
        const solvers::Field solution = body->solve();
        seconds.push_back(stopwatch.seconds());
        errors.push_back(displacement_error(*body, solution, field));
        if (method == Method::collocation)
          worst_row_balance = std::max(worst_row_balance, body->residual(solution));
      }
      series.x.push_back(1.0 / n);
      series.y.push_back(median(errors));
      spread = std::max(spread, largest(errors) / median(errors));
      if (n == bound_divisions)
        at_bound = median(errors);
      const int nodes = (n + 1) * (n + 1) * (n + 1);
      table.add({std::string(solvers::to_string(method)), fmt::format("{}", nu), fmt::format("{}", n),
                 fmt::format("{}", nodes), fmt::format("{:.5f}", median(errors)),
                 fmt::format("{:.5f}", largest(errors)), fmt::format("{:.1f}", 1e3 * median(seconds))});
      context.say(fmt::format("{}, nu = {}, {} nodes: median {:.4f}, worst {:.4f}", solvers::to_string(method), nu,
                              nodes, median(errors), largest(errors)));
    }
    figure.series.push_back(series);
    const std::string name = fmt::format("{}_nu{:02.0f}", solvers::to_string(method), 100 * nu);
    if (method == Method::published) {
      // Reported beside the paper's claim of first-order accuracy; only nonsense fails.
      checks.push_back({name + "_error_729_reported", at_bound, ">=", 0});
      checks.push_back({name + "_slope_reported", log_log_slope(series.x, series.y), ">=", -10});
      return;
    }
    for (const Bound& bound : error_bounds)
      if (bound.method == method && bound.poisson_ratio == nu)
        checks.push_back({name + "_error_729", at_bound, "<=", bound.error});
    checks.push_back({name + "_slope", log_log_slope(series.x, series.y), ">=", 1.8});
    checks.push_back({name + "_worst_over_median", spread, "<=", 2});
  };
  const std::vector<double> ratios = context.quick ? std::vector<double>{0.3} : std::vector<double>{0.3, 0.45, 0.49};
  for (Method method : {Method::collocation, Method::galerkin})
    for (double nu : ratios)
      study(method, nu);
  study(Method::published, 0.3);

  const ManufacturedField field = smooth_field({1, 0.3, 0});
  solvers::DiscretisationOptions options;
  options.method = Method::collocation;
  solvers::Problem problem = cube_problem(field, bound_divisions, jitter, 1);
  // The base is left to its constraint alone, which then has the whole resultant to carry.
  problem.loads.traction = [field](const Vector3& x, const Vector3& normal) {
    return normal.z() < -0.5 ? Vector3(Vector3::Zero()) : field.traction(x, normal);
  };
  const Vector3 applied = applied_force(problem, options);
  Vector3 unbalanced = applied;
  const auto body = solvers::discretise(problem, options);
  for (const Vector3& force : body->constraint_forces(body->solve()))
    unbalanced += force;
  checks.push_back({"collocation_row_balance", worst_row_balance, "<=", 1e-10});
  checks.push_back({"collocation_force_balance", unbalanced.norm() / applied.norm(), "<=", 1e-10});

  table.write(context.out / "errors.csv");
  app::write_png(figure, context.out / "errors.png");
  return checks;
}

} // namespace spherecut::experiments
