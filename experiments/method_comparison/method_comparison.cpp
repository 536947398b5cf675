// Problem:   which discretisation should be the default? Three problems whose answer is known, from a smooth field to a
//            contact edge, at several sizes, for several random node sets.
// Reference: the manufactured field; the exact punch; finite elements (see the experiments of the same names).
//            What counts is the error a method reaches in a given time, and that no node set goes astray.
// Command:   spherecut experiment run method_comparison --out DIR
#include "experiments/hemisphere_palpation/palpation.hpp"
#include "experiments/punch/press_punch.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/cube.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/stopwatch.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

using solvers::Method;

struct Outcome {
  int nodes = 0;
  double force_error = 0; // relative; NaN for a problem without a tool
  double field_error = 0; // relative L2 (cube), or largest on the surface over the peak displacement
  double build_seconds = 0, solve_seconds = 0;
};

constexpr double no_force = std::numeric_limits<double>::quiet_NaN();

Outcome smooth_cube(Method method, double nu, int nodes, std::uint64_t seed) {
  const ManufacturedField field = smooth_field({1, nu, 0});
  solvers::Problem problem = cube_problem(field, static_cast<int>(std::round(std::cbrt(nodes))) - 1, 0.25, seed);
  solvers::DiscretisationOptions options;
  options.method = method;
  const Stopwatch build;
  const auto body = solvers::discretise(std::move(problem), options);
  const double build_seconds = build.seconds();
  const Stopwatch solve;
  const solvers::Field solution = body->solve();
  return {body->report().nodes, no_force, displacement_error(*body, solution, field), build_seconds, solve.seconds()};
}

Outcome flat_punch(Method method, double nu, int nodes, std::uint64_t seed) {
  const PunchRun run = press_punch({Indenter::punch, method, nu, nodes, seed});
  return {run.body.nodes(), std::abs(run.force_ratio - 1), run.profile_error, run.body.build_seconds,
          run.body.condense_seconds + run.press_seconds};
}

Outcome hemisphere(Method method, double nu, int nodes, std::uint64_t seed) {
  const HemisphereReference reference = load_hemisphere_reference(nu);
  const HemispherePalpation run = palpate_hemisphere(method, nu, nodes, seed);
  double worst = 0;
  for (double angle : judged_angles())
    worst = std::max(worst, surface_error(run, reference, angle));
  return {run.nodes(), std::abs(run.force / reference.force - 1), worst, run.build_seconds, run.solve_seconds};
}

struct Case {
  std::string name;
  double poisson_ratio;
  std::vector<int> nodes;
  Outcome (*run)(Method, double nu, int nodes, std::uint64_t seed);
};

std::vector<Case> cases(bool quick) {
  if (quick)
    return {{"smooth_cube", 0.3, {125}, smooth_cube}, {"hemisphere", 0.3, {100}, hemisphere}};
  return {{"smooth_cube", 0.3, {125, 343, 729, 1331}, smooth_cube},
          {"smooth_cube", 0.49, {125, 343, 729, 1331}, smooth_cube},
          {"punch", 0.3, {300, 600, 1200}, flat_punch},
          {"punch", 0.49, {300, 600, 1200}, flat_punch},
          {"hemisphere", 0.3, {100, 300, 500, 1000}, hemisphere},
          {"hemisphere", 0.45, {100, 300, 500, 1000}, hemisphere}};
}

} // namespace

std::vector<Check> run_method_comparison(const ExperimentContext& context) {
  const int seeds = context.quick ? 2 : 5;
  std::vector<Check> checks;
  app::Table table({"problem", "poisson_ratio", "method", "nodes", "force_error", "force_error_worst_seed",
                    "field_error", "field_error_worst_seed", "build_ms", "solve_ms"});
  app::Figure figure{"Field error against time, nu = 0.3, median of seeds",
                     "assembly, factorisation, solve / ms",
                     "field error",
                     true,
                     true,
                     {}};
  for (Method method : {Method::galerkin, Method::collocation}) {
    const std::string method_name(solvers::to_string(method));
    double spread = 0;
    for (const Case& problem : cases(context.quick)) {
      app::Series series{problem.name + ", " + method_name, {}, {}};
      for (int target : problem.nodes) {
        std::vector<double> force, field, build, solve;
        int nodes = 0;
        for (int seed = 1; seed <= seeds; ++seed) {
          const Outcome outcome = problem.run(method, problem.poisson_ratio, target, seed);
          nodes = outcome.nodes;
          force.push_back(outcome.force_error);
          field.push_back(outcome.field_error);
          build.push_back(1e3 * outcome.build_seconds);
          solve.push_back(1e3 * outcome.solve_seconds);
        }
        const bool has_force = std::isfinite(force.front());
        table.add({problem.name, fmt::format("{}", problem.poisson_ratio), method_name, fmt::format("{}", nodes),
                   has_force ? fmt::format("{:.4f}", median(force)) : "",
                   has_force ? fmt::format("{:.4f}", largest(force)) : "", fmt::format("{:.4f}", median(field)),
                   fmt::format("{:.4f}", largest(field)), fmt::format("{:.1f}", median(build)),
                   fmt::format("{:.1f}", median(solve))});
        spread = std::max(spread, largest(field) / median(field));
        series.x.push_back(median(build) + median(solve));
        series.y.push_back(median(field));
        context.say(fmt::format("{}, nu = {}, {}, {} nodes: field {:.4f} (worst {:.4f}), {:.0f} + {:.0f} ms",
                                problem.name, problem.poisson_ratio, method_name, nodes, median(field), largest(field),
                                median(build), median(solve)));
      }
      if (problem.poisson_ratio == 0.3)
        figure.series.push_back(series);
    }
    checks.push_back({method_name + "_worst_seed_over_median", spread, "<=", 2});
  }
  table.write(context.out / "comparison.csv");
  app::write_png(figure, context.out / "error_against_time.png");
  return checks;
}

} // namespace spherecut::experiments
