// Problem:   the block of cutting_force, 4 x 0.4 x 2 m (E = 1 Pa, nu = 0.3, toughness 0.33 J/m2), cut by a wire: an
// edge
//            of the wire's radius r, whose contact ahead is as wide as that makes it, and half of whose girth wears the
//            faces behind it with a shear of 0.33 Pa, unless they gape wider than the wire is thick.
// Measured:  wires through polyacrylamide gels [Goda and others 2024]: the force per thickness does not depend on the
//            radius below a transition and rises linearly above; its least value is the toughness, its slope follows
//            from the shear strength.
// Reference: toughness, and pi r times the shear on top of it; balance of work.
// Command:   spherecut experiment run wire_cutting --out DIR
#include "experiments/measured.hpp"
#include "experiments/support/cutting_run.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double gel_toughness = 0.33, wear_strength = 0.33; // J/m2, Pa
constexpr double wire_increment = 0.1;                       // m

struct Line {
  double at_zero = 0, slope = 0;
};

/// Least squares over the points from `first` to before `last`.
Line fitted_line(const app::Series& points, std::size_t first, std::size_t last) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double x = points.x[k], y = points.y[k];
    n += 1;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return {(sy - slope * sx) / n, slope};
}

} // namespace

std::vector<Check> run_wire_cutting(const ExperimentContext& context) {
  const std::vector<double> radii = context.quick ? std::vector<double>{0.02, 0.1, 0.2, 0.4}
                                                  : std::vector<double>{0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4};
  constexpr double notch = 1; // m, cut before the wire comes
  const int count = context.quick ? 6 : 11;
  const double steady_from = context.quick ? 1.3 : 1.4;
  std::vector<Check> checks;
  app::Table table({"radius_m", "half_width_m", "nodes", "smooth_N_m", "worn_N_m", "wanted_N_m", "opening_m",
                    "opening_over_thickness"});
  app::Series smooth{"no wear", {}, {}}, worn{"worn faces", {}, {}};
  double plateau = 0, worst_balance = 0;
  for (const double radius : radii) {
    CuttingCase block;
    block.path = notch + (count + 1) * wire_increment;
    block.flank = 0.5 * std::numbers::pi * radius;
    block.shear = wear_strength;
    block.gauge = radius;
    block.half_width =
        std::max(0.75 * block.spacing, solvers::edge_half_width(block.material, radius, gel_toughness)); // as in a run
    std::vector<double> depths;
    for (int k = 0; k <= count; ++k)
      depths.push_back(notch + k * wire_increment);
    const std::vector<CuttingBody> bodies = cutting_bodies(block, depths);
    CuttingCase without = block;
    without.shear = 0;
    const Knife knife{gel_toughness};
    const CuttingRun free = run_blade(without, bodies, knife, steady_from);
    // How far the faces are apart where the wire is thickest, in steady cutting without wear.
    const CuttingBody& deep = bodies[bodies.size() - 2];
    const double opening = deep.gauge.dot(push_blade(deep.patch, deep.advance(deep.depth + free.lag)).forces);
    const bool rubs = opening < 2 * radius;
    const CuttingRun run = rubs ? run_blade(block, bodies, knife, steady_from) : free;
    const double wanted = gel_toughness + (rubs ? std::numbers::pi * radius * wear_strength : 0);
    smooth.x.push_back(radius);
    smooth.y.push_back(free.steady / block.front());
    worn.x.push_back(radius);
    worn.y.push_back(run.steady / block.front());
    context.say(
        fmt::format("radius {:g} m, contact of {:.3f} m: {:.4f} N/m, with wear {:.4f} N/m ({:.4f}); faces {:.4f} m "
                    "apart, {:.2f} of its thickness",
                    radius, block.half_width, smooth.y.back(), worn.y.back(), wanted, opening, opening / (2 * radius)));
    table.add(std::vector<double>{radius, block.half_width, static_cast<double>(bodies[0].nodes.size()),
                                  smooth.y.back(), worn.y.back(), wanted, opening, opening / (2 * radius)});
    plateau = std::max(plateau, std::abs(smooth.y.back() / gel_toughness - 1));
    worst_balance = std::max({worst_balance, free.ledger.imbalance(), run.ledger.imbalance()});
  }
  const Line all = fitted_line(worn, 0, radii.size());
  const std::size_t below = radii.size() / 2; // the small wires and the thick ones
  const double thin = fitted_line(worn, 0, below).slope, thick = fitted_line(worn, below, radii.size()).slope;
  context.say(fmt::format("intercept {:.4f} J/m2, slope {:.4f} Pa; of thin wires {:.4f}, of thick ones {:.4f} Pa",
                          all.at_zero, all.slope, thin, thick));
  checks.push_back({"wire_cutting_without_wear", plateau, "<=", 0.05});
  checks.push_back({"wire_cutting_intercept", std::abs(all.at_zero / gel_toughness - 1), "<=", 0.05});
  checks.push_back({"wire_cutting_slope", std::abs(thick / (std::numbers::pi * wear_strength) - 1), "<=", 0.05});
  checks.push_back({"wire_cutting_transition", thin / thick, "<=", 0.2});
  checks.push_back({"wire_cutting_work_balance", worst_balance, "<=", 0.05});
  table.write(context.out / "radii.csv");
  app::write_png(
      {"Force of a wire against its radius",
       "radius [m]",
       "force / thickness [N/m]",
       false,
       false,
       {smooth,
        worn,
        {"toughness", {radii.front(), radii.back()}, {gel_toughness, gel_toughness}, app::SeriesStyle::lines}}},
      context.out / "radii.png");
  return checks;
}

} // namespace spherecut::experiments
