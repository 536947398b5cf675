// Problem:   a rigid sphere of radius R, frictionless, is pressed into an elastic half-space to several depths d, the
//            last with contact radius sqrt(R d) = a. Local domain of half-width 4 a, its far boundary coupled to the
//            half-space; the patch in contact is an outcome. d = 1e-4 a, so that nothing but contact is nonlinear.
// Reference: F = (4/3) E / (1 - nu^2) sqrt(R) d^(3/2); surface beside the contact [Hertz 1882; Johnson 1985, ch. 4].
// Command:   spherecut experiment run hertz --out DIR
#include "experiments/analytic/half_space.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/half_space_contact.hpp"
#include "experiments/support/statistics.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

using solvers::Method;

constexpr double depth = 1e-4 * contact_radius; // the deepest press
constexpr double sphere_radius = contact_radius * contact_radius / depth;

/// One size and Poisson ratio with the bounds of the default method and of the other; 0: no bound.
struct Size {
  double poisson_ratio;
  int nodes;
  double force_bound_galerkin, force_bound_collocation, profile_bound;
  bool curve; // contact radius and exponent bounded
};

const std::vector<Size> sizes = {{0.3, 300, 0.06, 0.06, 0, false},
                                 {0.3, 600, 0, 0, 0, false},
                                 {0.3, 1200, 0.02, 0.035, 0.03, true},
                                 {0.49, 1500, 0.05, 0.05, 0.03, true}};

struct Outcome {
  double force_ratio = 0, profile_error = 0, imbalance = 0;
  double radius_error = 0; // in units of the spacing
  double exponent = 0;     // of force against depth
  std::vector<double> depths, forces;
  std::vector<SurfaceSample> profile;
};

Outcome press_sphere(const HalfSpaceBody& body, const solvers::Material& material) {
  const topology::SphereTip sphere{sphere_radius};
  solvers::ContactOptions options;
  options.gap_tolerance = 1e-9 * depth;
  Outcome outcome;
  solvers::ContactState state;
  // Contact radii 0.5, 0.6 .. 1 of the largest.
  for (double share : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    const double at = depth * share * share;
    state = solvers::press(body.patch, sphere, topology::pose_at(sphere, {0, 0, -at}), options);
    outcome.depths.push_back(at);
    outcome.forces.push_back(state.tool_force.z());
  }
  outcome.exponent = log_log_slope(outcome.depths, outcome.forces);
  outcome.force_ratio = state.tool_force.z() / hertz_contact(material, sphere_radius, depth).force;
  outcome.radius_error = std::abs(state.contact_radius - contact_radius) / body.fine;
  const solvers::Field field = solvers::deform(body.patch, state);
  outcome.profile = surface_profile(body, field, contact_radius + body.fine, 3 * contact_radius,
                                    [](double r) { return hertz_profile(sphere_radius, depth, r); });
  for (const SurfaceSample& sample : outcome.profile)
    outcome.profile_error = std::max(outcome.profile_error, sample.largest_error / depth);
  outcome.imbalance = far_force_imbalance(body, state, field);
  return outcome;
}

} // namespace

std::vector<Check> run_hertz(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 5;
  std::vector<Check> checks;
  std::vector<std::string> columns = half_space_columns();
  columns.insert(columns.end(), {"radius_error_spacings", "exponent"});
  app::Table table(columns);
  app::Figure curve{"Sphere on a half-space, about 1200 nodes", "depth d / a", "F / (E a^2)", true, true, {}};
  app::Series exact{"Hertz", {}, {}, app::SeriesStyle::lines};
  double worst_imbalance = 0;
  for (Method method : {Method::galerkin, Method::collocation})
    for (const Size& size : sizes) {
      if (context.quick && size.nodes > 300)
        continue;
      const solvers::Material material{1, size.poisson_ratio, 0};
      std::vector<double> ratios, errors, radii, exponents;
      for (int seed = 1; seed <= seeds; ++seed) {
        const HalfSpaceCase half_space{Indenter::sphere, method, size.poisson_ratio, size.nodes,
                                       static_cast<std::uint64_t>(seed)};
        const HalfSpaceBody body = half_space_body(half_space);
        const Outcome outcome = press_sphere(body, material);
        worst_imbalance = std::max(worst_imbalance, outcome.imbalance);
        ratios.push_back(outcome.force_ratio);
        errors.push_back(outcome.profile_error);
        radii.push_back(outcome.radius_error);
        exponents.push_back(outcome.exponent);
        std::vector<std::string> row =
            half_space_row(half_space, body, outcome.force_ratio, outcome.profile_error, outcome.imbalance);
        row.push_back(fmt::format("{:.2f}", outcome.radius_error));
        row.push_back(fmt::format("{:.3f}", outcome.exponent));
        table.add(row);
        if (seed == 1 && size.poisson_ratio == 0.3 && size.nodes == (context.quick ? 300 : 1200)) {
          if (exact.x.empty()) {
            exact.x = outcome.depths;
            for (double at : outcome.depths)
              exact.y.push_back(hertz_contact(material, sphere_radius, at).force);
            curve.series.push_back(exact);
          }
          curve.series.push_back(
              {std::string(solvers::to_string(method)), outcome.depths, outcome.forces, app::SeriesStyle::points});
        }
      }
      context.say(fmt::format("{}, nu = {}, about {} nodes: force / exact {:.4f} ({:.4f} to {:.4f}), profile {:.4f}, "
                              "radius {:.2f} spacings off, exponent {:.3f}",
                              solvers::to_string(method), size.poisson_ratio, size.nodes, median(ratios),
                              *std::min_element(ratios.begin(), ratios.end()), largest(ratios), median(errors),
                              median(radii), median(exponents)));
      const std::string name =
          fmt::format("hertz_{}_nu{:02.0f}_{}", solvers::to_string(method), 100 * size.poisson_ratio, size.nodes);
      const double force_bound = method == Method::galerkin ? size.force_bound_galerkin : size.force_bound_collocation;
      if (force_bound > 0)
        checks.push_back({name + "_force", std::abs(median(ratios) - 1), "<=", force_bound});
      if (size.profile_bound > 0)
        checks.push_back({name + "_profile", median(errors), "<=", size.profile_bound});
      if (size.curve) {
        checks.push_back({name + "_contact_radius_in_spacings", median(radii), "<=", 1});
        checks.push_back({name + "_exponent_error", std::abs(median(exponents) - 1.5), "<=", 0.05});
      }
    }
  checks.push_back({"hertz_contact_force_equals_far_force", worst_imbalance, "<=", 1e-3});
  table.write(context.out / "runs.csv");
  app::write_png(curve, context.out / "force.png");
  return checks;
}

} // namespace spherecut::experiments
