// Problem:   a block 480 x 48 x 240 mm of liver between two held faces; a straight edge is pushed into its free end and
//            cuts it along its middle. E = 6 kPa, and 3 and 8 kPa, nu = 0.45; the edge's radius is 0.1 mm, its contact
//            as wide as that makes it, or as the nodes can tell.
// Measured:  toughness of bovine liver 164 +- 6 J/m2 [Gokgol and others 2012], of porcine liver by blades 187 to
//            225 J/m2. Steady cutting by an ideal edge takes that much a metre of it: 0.164 N/mm.
// Reference: steady cutting, toughness times the length of the edge, whatever the modulus; balance of work.
// Command:   spherecut experiment run liver_blade --out DIR
#include "experiments/measured.hpp"
#include "experiments/support/cutting_run.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <span>
#include <string>

namespace spherecut::experiments {

namespace {

struct LiverToughness {
  const char* name;
  double value; // J/m2
};

constexpr std::array liver_toughness{
    LiverToughness{"bovine", 164},            // [Gokgol, Basdogan and Canadinc 2012]
    LiverToughness{"porcine_blade_low", 187}, // [10.1186/s10033-022-00767-4, table 2]
    LiverToughness{"porcine_blade_high", 225},
};
constexpr double liver_modulus = 6000, liver_poisson_ratio = 0.45; // Pa
constexpr std::array liver_moduli{3000.0, 6000.0, 8000.0};         // Pa, small strain
constexpr double blade_stroke = 0.006, blade_reach = 0.9;          // m
constexpr double edge_radius = 1e-4;                               // m

CuttingCase liver_block(double spacing) {
  CuttingCase block;
  block.length = 0.48;
  block.height = 0.24;
  block.width = 0.048;
  block.above = 0.0036;
  block.spacing = spacing;
  block.material = {liver_modulus, liver_poisson_ratio, 0};
  // What the nodes can tell, as in a run (src/blade/edge.cpp).
  block.half_width = std::max(0.75 * spacing, solvers::edge_half_width(block.material, edge_radius, 164));
  return block;
}

/// The same block of another modulus: compliances are inversely proportional to it.
void set_modulus(std::vector<CuttingBody>& bodies, double from, double to) {
  for (CuttingBody& body : bodies)
    body.patch.compliance *= from / to;
}

} // namespace

std::vector<Check> run_liver_blade(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table runs({"toughness_J_m2", "young_modulus_Pa", "nodes", "steady_N_mm", "lag_mm", "work_mJ", "surface_mJ",
                   "excess_mJ", "stored_mJ"});
  app::Table onsets({"spacing_mm", "nodes", "half_width_mm", "toughness_J_m2", "young_modulus_Pa", "onset_mm",
                     "onset_N_mm", "first_cut_mm"});
  app::Figure figure{"A straight edge through liver", "way of the blade [mm]", "force / edge [N/mm]", false, false, {}};
  const auto is_run = [](double modulus, const LiverToughness& toughness) {
    return modulus == liver_modulus || toughness.value == liver_toughness[0].value;
  };

  // Steady cutting, from a notch.
  CuttingCase block = liver_block(0.012);
  constexpr double notch = 0.12, increment = 0.012; // m
  const int count = context.quick ? 6 : 12;
  const double steady_from = notch + 3 * increment;
  block.path = notch + (count + 1) * increment;
  std::vector<double> depths;
  for (int k = 0; k <= count; ++k)
    depths.push_back(notch + k * increment);
  std::vector<CuttingBody> bodies = cutting_bodies(block, depths);
  double worst_balance = 0, least = std::numeric_limits<double>::infinity(), most = 0, modulus = liver_modulus;
  const double edge = 1e3 * block.front(); // mm
  for (const double now : liver_moduli) {
    set_modulus(bodies, modulus, now);
    modulus = now;
    for (const LiverToughness& toughness : liver_toughness) {
      if (!is_run(now, toughness))
        continue;
      const CuttingRun run = run_blade(block, bodies, {toughness.value, 1, blade_stroke, blade_reach}, steady_from);
      const double force = run.steady / edge; // N/mm
      worst_balance = std::max(worst_balance, run.ledger.imbalance());
      context.say(fmt::format("{} J/m2, E = {} kPa: {:.4f} N/mm, the blade {:.1f} mm ahead of its cut", toughness.value,
                              1e-3 * now, force, 1e3 * run.lag));
      runs.add(std::vector<double>{toughness.value, now, static_cast<double>(bodies[0].nodes.size()), force,
                                   1e3 * run.lag, 1e3 * run.ledger.work, 1e3 * run.ledger.surface,
                                   1e3 * run.ledger.excess, 1e3 * run.ledger.stored});
      if (now == liver_modulus) {
        checks.push_back({fmt::format("liver_blade_{}_steady", toughness.name),
                          std::abs(force / (1e-3 * toughness.value) - 1), "<=", 0.05});
        app::Series series{fmt::format("{:g} J/m2", toughness.value), run.blade, run.force, app::SeriesStyle::lines};
        for (double& x : series.x)
          x *= 1e3;
        for (double& y : series.y)
          y /= edge;
        figure.series.push_back(series);
      }
      if (toughness.value == liver_toughness[0].value) {
        least = std::min(least, force);
        most = std::max(most, force);
      }
    }
  }
  checks.push_back({"liver_blade_modulus_spread", most / least - 1, "<=", 0.05});
  checks.push_back({"liver_blade_work_balance", worst_balance, "<=", 0.05});

  // How far the edge goes in before it cuts, on finer nodes too, which tell a narrower contact.
  for (const double spacing : context.quick ? std::vector{0.012} : std::vector{0.012, 0.0085}) {
    CuttingCase fine = liver_block(spacing);
    fine.path = 0.18;
    std::vector<double> lengths{0};
    for (const double length : {0.012, 0.024, 0.048, 0.072, 0.108, 0.144, 0.18})
      lengths.push_back(length);
    std::vector<CuttingBody> cuts = cutting_bodies(fine, lengths);
    modulus = liver_modulus;
    for (const double now : liver_moduli) {
      set_modulus(cuts, modulus, now);
      modulus = now;
      for (const LiverToughness& toughness : liver_toughness) {
        if (!is_run(now, toughness))
          continue;
        const std::string what =
            fmt::format("{} J/m2, E = {} kPa, nodes {:.1f} mm apart ({}), contact of {:.2f} mm", toughness.value,
                        1e-3 * now, 1e3 * spacing, cuts[0].nodes.size(), 1e3 * fine.half_width);
        Rupture rupture;
        try {
          rupture = first_rupture(fine, cuts[0], std::span<const CuttingBody>(cuts).subspan(1),
                                  {toughness.value, 1, blade_stroke, blade_reach});
        } catch (const NumericalError& error) {
          context.say(fmt::format("{}: {}", what, error.what()));
          continue;
        }
        context.say(fmt::format("{}: cuts from {:.1f} mm on, at {:.3f} N/mm, {:.0f} mm at once", what,
                                1e3 * rupture.blade, rupture.force / edge, 1e3 * rupture.length));
        onsets.add(std::vector<double>{1e3 * spacing, static_cast<double>(cuts[0].nodes.size()), 1e3 * fine.half_width,
                                       toughness.value, now, 1e3 * rupture.blade, rupture.force / edge,
                                       1e3 * rupture.length});
        if (now == liver_modulus)
          checks.push_back({fmt::format("liver_blade_{}_{:.1f}mm_onset_reported", toughness.name, 1e3 * spacing),
                            1e3 * rupture.blade, ">=", 0});
      }
    }
  }
  runs.write(context.out / "runs.csv");
  onsets.write(context.out / "onsets.csv");
  app::write_png(figure, context.out / "force.png");
  return checks;
}

} // namespace spherecut::experiments
