// Problem:   a block 4 x 0.4 x 2 m (E = 1 Pa, nu = 0.3) between two held faces; a straight blade is pushed into its
//            free end and cuts it along its middle, in a plane that is tilted and shifted. The contact of the edge is
//            3.5, 4.9 and 7 spacings wide (half width), the same in metres. Lips in frictionless contact.
// Reference: the force of steady cutting, G_c times the width of the front; the force and depth of the first rupture on
//            other spacings; work = G_c area + stored energy + friction.
//            Under tension (tension.hpp): G_c less what the tension releases.
// Command:   spherecut experiment run cutting_force --out DIR
#include "experiments/cutting_force/tension.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/cutting_run.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

constexpr double toughness = 0.33; // J/m2: 0.3 m of plane modulus
constexpr double blunt_sharpness = 0.75;

std::vector<CuttingBody> cut_to(const CuttingCase& block, const CuttingBody& uncut, const std::vector<double>& depths) {
  std::vector<CuttingBody> cuts;
  cuts.reserve(depths.size());
  for (const double depth : depths)
    cuts.push_back(cutting_body(block, depth, &uncut.nodes));
  return cuts;
}

/// From nothing through the first cut to a depth.
std::vector<double> depths_to(double depth, double first, double increment) {
  std::vector<double> depths{0, first};
  while (depths.back() < depth)
    depths.push_back(depths.back() + increment);
  return depths;
}

} // namespace

std::vector<Check> run_cutting_force(const ExperimentContext& context) {
  const std::vector<double> spacings =
      context.quick ? std::vector<double>{0.1, 0.1 / 1.4} : std::vector<double>{0.08, 0.08 / 1.4, 0.04};
  const std::vector<double> lengths =
      context.quick ? std::vector<double>{0.2, 0.4} : std::vector<double>{0.1, 0.2, 0.3, 0.4, 0.5};
  const double steady_from = context.quick ? 1.2 : 1.4, depth = context.quick ? 1.6 : 2.2, increment = 0.1;
  std::vector<Check> checks;
  app::Table ruptures({"method", "spacing", "nodes", "length_m", "force_N", "blade_m"});
  app::Table runs({"method", "sharpness", "shear_Pa", "steady_N", "wanted_N", "rupture_N", "after_rupture_N", "work_J",
                   "surface_J", "crushing_J", "friction_J", "excess_J", "stored_J"});
  app::Figure figure{
      "Force of a blade that cuts a block", "blade [m]", "force / (toughness x width)", false, false, {}};
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    const std::string name(solvers::to_string(method));
    double least_force = std::numeric_limits<double>::infinity(), most_force = 0, least_blade = least_force,
           most_blade = 0;
    std::array<double, 2> first_length{}; // of the ideal and the blunt edge on the coarsest nodes
    for (const double spacing : spacings) {
      CuttingCase block;
      block.method = method;
      block.spacing = spacing;
      block.path = lengths.back();
      const CuttingBody uncut = cutting_body(block, 0, nullptr);
      const std::vector<CuttingBody> cuts = cut_to(block, uncut, lengths);
      const Rupture rupture = first_rupture(block, uncut, cuts, {toughness});
      if (spacing == spacings.front())
        first_length = {rupture.length, first_rupture(block, uncut, cuts, {toughness, blunt_sharpness}).length};
      least_force = std::min(least_force, rupture.force);
      most_force = std::max(most_force, rupture.force);
      least_blade = std::min(least_blade, rupture.blade);
      most_blade = std::max(most_blade, rupture.blade);
      ruptures.add({name, fmt::format("{:.4f}", spacing), fmt::format("{}", uncut.nodes.size()),
                    fmt::format("{:.2f}", rupture.length), fmt::format("{:.5f}", rupture.force),
                    fmt::format("{:.5f}", rupture.blade)});
      context.say(fmt::format("{}, spacing {:.3f} m: {} nodes, first cut of {:.2f} m at {:.4f} N, {:.4f} m", name,
                              spacing, uncut.nodes.size(), rupture.length, rupture.force, rupture.blade));
    }
    checks.push_back({"cutting_force_" + name + "_rupture_force_spread", most_force / least_force - 1, "<=", 0.05});
    checks.push_back({"cutting_force_" + name + "_rupture_depth_spread", most_blade / least_blade - 1, "<=", 0.05});
    for (const bool ideal : {true, false}) {
      CuttingCase block;
      block.method = method;
      block.path = depth + increment;
      const double sharpness = ideal ? 1 : blunt_sharpness;
      if (!ideal) {
        block.flank = 0.3;
        block.shear = 0.05;
      }
      const std::vector<CuttingBody> bodies =
          cutting_bodies(block, depths_to(depth, first_length[ideal ? 0 : 1], increment));
      const CuttingRun run = run_blade(block, bodies, {toughness, sharpness}, steady_from);
      const double cutting = toughness / sharpness * block.front();
      const double wanted = cutting + 2 * block.shear * block.flank * block.front();
      const solvers::BladeLedger& ledger = run.ledger;
      const double spent = ledger.surface + ledger.crushing + ledger.friction + ledger.stored;
      runs.add({name, fmt::format("{:g}", sharpness), fmt::format("{:g}", block.shear),
                fmt::format("{:.5f}", run.steady), fmt::format("{:.5f}", wanted),
                fmt::format("{:.5f}", run.rupture_force), fmt::format("{:.5f}", run.after_rupture),
                fmt::format("{:.5f}", ledger.work), fmt::format("{:.5f}", ledger.surface),
                fmt::format("{:.5f}", ledger.crushing), fmt::format("{:.5f}", ledger.friction),
                fmt::format("{:.5f}", ledger.excess), fmt::format("{:.5f}", ledger.stored)});
      context.say(
          fmt::format("{}{}: steady force {:.4f} of {:.4f} N, rupture at {:.4f} N, then {:.4f} N; work {:.4f} J, "
                      "spent and stored {:.4f} J",
                      name, ideal ? "" : ", blunt and dragging", run.steady, wanted, run.rupture_force,
                      run.after_rupture, ledger.work, spent));
      const std::string prefix = "cutting_force_" + name + (ideal ? "" : "_blunt");
      checks.push_back({prefix + "_steady", std::abs(run.steady / wanted - 1), "<=", 0.05});
      checks.push_back({prefix + "_work_balance", std::abs(ledger.work - spent) / ledger.work, "<=", 0.05});
      if (ideal)
        checks.push_back({prefix + "_rupture_over_steady", run.rupture_force / run.steady, ">=", 1.2});
      app::Series series{name + (ideal ? "" : ", sharpness 0.75, friction"), run.blade, run.force,
                         app::SeriesStyle::lines};
      for (double& force : series.y)
        force /= toughness * block.front();
      figure.series.push_back(series);
    }
  }
  cut_under_tension(context, checks);
  ruptures.write(context.out / "ruptures.csv");
  runs.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "force.png");
  return checks;
}

} // namespace spherecut::experiments
