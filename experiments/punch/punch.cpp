// Problem:   a rigid flat punch of radius a, frictionless, is pressed to depth d = 1e-6 a into an elastic half-space.
// Local
//            domain of half-width 4 a, its far boundary coupled to the half-space; contact unilateral.
// Reference: F = 2 E a d / (1 - nu^2); depth of the surface beside the punch (2 d / pi) asin(a / r) [Sneddon 1965].
// Command:   spherecut experiment run punch --out DIR
#include "experiments/analytic/half_space.hpp"
#include "experiments/punch/press_punch.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/statistics.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

using solvers::Method;

/// One size and Poisson ratio with the bounds of the default method and of the other; 0: no bound.
struct Size {
  double poisson_ratio;
  int nodes;
  double force_bound_galerkin, force_bound_collocation, profile_bound;
};

const std::vector<Size> sizes = {
    {0.3, 300, 0.06, 0.06, 0}, {0.3, 600, 0, 0, 0}, {0.3, 1200, 0.02, 0.035, 0.03}, {0.49, 1500, 0.05, 0.05, 0.03}};

/// Adds the surface of one run to the figure, the first time with the exact one.
void draw_profile(const PunchRun& run, const std::string& method, app::Figure& figure) {
  app::Series computed{fmt::format("{}, {} nodes", method, run.body.nodes()), {}, {}, app::SeriesStyle::points};
  app::Series exact{"exact", {}, {}, app::SeriesStyle::lines};
  for (const SurfaceSample& sample : run.profile) {
    computed.x.push_back(sample.r / contact_radius);
    computed.y.push_back(sample.mean / punch_depth);
    exact.x.push_back(sample.r / contact_radius);
    exact.y.push_back(flat_punch_profile(contact_radius, punch_depth, sample.r) / punch_depth);
  }
  if (figure.series.empty())
    figure.series.push_back(exact);
  figure.series.push_back(computed);
}

} // namespace

std::vector<Check> run_punch(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 5;
  std::vector<Check> checks;
  app::Table table(half_space_columns());
  app::Figure forces{"Flat punch: force over exact", "nodes", "F / F exact", true, false, {}};
  app::Figure profiles{"Flat punch: surface beside the punch", "r / a", "depth / d", false, false, {}};
  double worst_imbalance = 0;
  for (Method method : {Method::galerkin, Method::collocation}) {
    app::Series dots{std::string(solvers::to_string(method)) + ", nu = 0.3", {}, {}, app::SeriesStyle::points};
    for (const Size& size : sizes) {
      const double force_bound = method == Method::galerkin ? size.force_bound_galerkin : size.force_bound_collocation;
      if (context.quick && size.nodes > 300)
        continue;
      std::vector<double> ratios, errors;
      for (int seed = 1; seed <= seeds; ++seed) {
        const HalfSpaceCase half_space{Indenter::punch, method, size.poisson_ratio, size.nodes,
                                       static_cast<std::uint64_t>(seed)};
        const PunchRun run = press_punch(half_space);
        worst_imbalance = std::max(worst_imbalance, run.imbalance);
        ratios.push_back(run.force_ratio);
        errors.push_back(run.profile_error);
        table.add(half_space_row(half_space, run.body, run.force_ratio, run.profile_error, run.imbalance));
        if (size.poisson_ratio == 0.3) {
          dots.x.push_back(run.body.nodes());
          dots.y.push_back(run.force_ratio);
        }
        if (size.poisson_ratio == 0.3 && size.nodes == (context.quick ? 300 : 1200) && seed == 1)
          draw_profile(run, std::string(solvers::to_string(method)), profiles);
      }
      context.say(fmt::format("{}, nu = {}, about {} nodes: force / exact {:.4f} ({:.4f} to {:.4f}), profile {:.4f}",
                              solvers::to_string(method), size.poisson_ratio, size.nodes, median(ratios),
                              *std::min_element(ratios.begin(), ratios.end()), largest(ratios), median(errors)));
      const std::string name =
          fmt::format("punch_{}_nu{:02.0f}_{}", solvers::to_string(method), 100 * size.poisson_ratio, size.nodes);
      if (force_bound > 0)
        checks.push_back({name + "_force", std::abs(median(ratios) - 1), "<=", force_bound});
      if (size.profile_bound > 0)
        checks.push_back({name + "_profile", median(errors), "<=", size.profile_bound});
    }
    forces.series.push_back(dots);
  }
  checks.push_back({"punch_contact_force_equals_far_force", worst_imbalance, "<=", 1e-3});
  table.write(context.out / "runs.csv");
  app::write_png(forces, context.out / "force.png");
  app::write_png(profiles, context.out / "profile.png");
  return checks;
}

} // namespace spherecut::experiments
