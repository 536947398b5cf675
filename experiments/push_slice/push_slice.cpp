// Problem:   the block of cutting_force, 4 x 0.4 x 2 m (E = 1 Pa, nu = 0.3, toughness 0.33 J/m2), and an edge that
// moves
//            along itself by xi for every metre that it goes ahead, the tissue at it going along.
// Measured:  slicing starts a cut at little deformation of the bulk, pushing alone deep in [Reyssat and others 2012]:
// how
//            far the blade has gone ahead when it first cuts must fall with xi.
// Reference: steady cutting, G_c w / (1 + xi^2) ahead and xi times that along the edge [Atkins, Xu and Jeronimidis
//            2004]; balance of work.
// Command:   spherecut experiment run push_slice --out DIR
#include "experiments/measured.hpp"
#include "experiments/support/cutting_run.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double block_toughness = 0.33; // J/m2

/// Evenly at first; then, some way before the means begin, by less than the blade is ahead of its cut, which falls
/// with the ratio.
std::vector<double> depths_of_cuts(double ratio, double steady_from, double way) {
  constexpr double step = 0.1, before = 0.2; // m
  std::vector<double> depths{0};
  while (depths.back() < steady_from - before - 1e-9)
    depths.push_back(depths.back() + step);
  const double from = depths.back();
  const int fine = static_cast<int>(std::ceil((before + way) / step * (1 + 0.5 * ratio * ratio)));
  for (int k = 1; k <= fine; ++k)
    depths.push_back(from + (before + way) * k / fine);
  return depths;
}

} // namespace

std::vector<Check> run_push_slice(const ExperimentContext& context) {
  const std::vector<double> ratios =
      context.quick ? std::vector<double>{0, 1, 2} : std::vector<double>{0, 0.5, 1, 2, 3};
  const double steady_from = context.quick ? 0.8 : 1.0, way = context.quick ? 0.2 : 0.4; // m
  std::vector<Check> checks;
  app::Table table({"slice_push_ratio", "nodes", "onset_m", "onset_N", "onset_along_N", "first_cut_m", "steady_N",
                    "steady_wanted_N", "steady_along_N", "steady_along_wanted_N", "lag_m", "work_J", "spent_J"});
  app::Series onset{"onset / that of pushing", {}, {}}, ahead{"steady force ahead / (G_c w)", {}, {}},
      along{"steady force along / (G_c w)", {}, {}}, formula_ahead{"1 / (1 + xi^2)", {}, {}, app::SeriesStyle::lines},
      formula_along{"xi / (1 + xi^2)", {}, {}, app::SeriesStyle::lines};
  double worst_ahead = 0, worst_along = 0, worst_balance = 0, largest_rise = 0, pushed = 0, before = 0;
  for (const double ratio : ratios) {
    CuttingCase block;
    block.slice = ratio;
    block.length = 3;
    block.height = 1.2;
    block.width = 0.8;
    block.path = steady_from + way + 0.1;
    const std::vector<CuttingBody> bodies = cutting_bodies(block, depths_of_cuts(ratio, steady_from, way));
    const Knife knife{block_toughness};
    const std::span<const CuttingBody> all(bodies);
    const Rupture rupture = first_rupture(block, bodies[0], all.subspan(1, 5), knife);
    const CuttingRun run = run_blade(block, bodies, knife, steady_from, 1 + rupture.cut);
    const double whole = block_toughness * block.front(), share = 1 / (1 + ratio * ratio);
    const auto& ledger = run.ledger;
    const double spent = ledger.surface + ledger.crushing + ledger.friction + ledger.excess + ledger.stored;
    context.say(fmt::format("ratio {:g}: first cut of {:.1f} m at {:.4f} m, {:.4f} N; steady {:.4f} N ahead ({:.4f}), "
                            "{:.4f} N along ({:.4f}); lag {:.3f} m",
                            ratio, rupture.length, rupture.blade, rupture.force, run.steady, whole * share,
                            run.steady_along, ratio * whole * share, run.lag));
    table.add({fmt::format("{:g}", ratio), fmt::format("{}", bodies[0].nodes.size()),
               fmt::format("{:.5f}", rupture.blade), fmt::format("{:.5f}", rupture.force),
               fmt::format("{:.5f}", ratio * rupture.force), fmt::format("{:.1f}", rupture.length),
               fmt::format("{:.5f}", run.steady), fmt::format("{:.5f}", whole * share),
               fmt::format("{:.5f}", run.steady_along), fmt::format("{:.5f}", ratio * whole * share),
               fmt::format("{:.4f}", run.lag), fmt::format("{:.5f}", ledger.work), fmt::format("{:.5f}", spent)});
    worst_ahead = std::max(worst_ahead, std::abs(run.steady / (whole * share) - 1));
    worst_along = std::max(worst_along, std::abs(run.steady_along - ratio * whole * share) / whole);
    worst_balance = std::max(worst_balance, ledger.imbalance());
    if (ratio == 0)
      pushed = rupture.blade;
    else
      largest_rise = std::max(largest_rise, rupture.blade / before);
    before = rupture.blade;
    onset.x.push_back(ratio);
    onset.y.push_back(rupture.blade / pushed);
    ahead.x.push_back(ratio);
    ahead.y.push_back(run.steady / whole);
    along.x.push_back(ratio);
    along.y.push_back(run.steady_along / whole);
  }
  for (double xi = 0; xi <= ratios.back() + 1e-9; xi += 0.02 * ratios.back()) {
    formula_ahead.x.push_back(xi);
    formula_ahead.y.push_back(1 / (1 + xi * xi));
    formula_along.x.push_back(xi);
    formula_along.y.push_back(xi / (1 + xi * xi));
  }
  checks.push_back({"push_slice_onset_falls", largest_rise, "<=", 0.99}); // from each ratio to the next
  checks.push_back({"push_slice_onset_at_largest_reported", before / pushed, ">=", 0});
  checks.push_back({"push_slice_steady_ahead", worst_ahead, "<=", 0.05});
  checks.push_back({"push_slice_steady_along", worst_along, "<=", 0.05});
  checks.push_back({"push_slice_work_balance", worst_balance, "<=", 0.05});
  table.write(context.out / "ratios.csv");
  app::write_png({"Slicing and pushing",
                  "slice-push ratio",
                  "",
                  false,
                  false,
                  {onset, ahead, along, formula_ahead, formula_along}},
                 context.out / "ratios.png");
  return checks;
}

} // namespace spherecut::experiments
