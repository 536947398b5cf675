// Problem:   random and degenerate blades against seven organs, with fissures, thin walls, a cavity and islands among
// them: swept, flat, waved, crossing, closed, through vertices,
//            along edges, coplanar, grazing, cut twice. Every cut grows stage by stage.
//            A body of four of them, held below, is solved with the cut as precuts.
// Reference: the wound's own invariants, recounted by other means than those that made it (closed, manifold, volume,
//            components, Euler characteristics), and the same cut made at once, triangle by triangle. What is solved
//            moves by less than the organ's size, or the run says so; what is refused has a reason.
// Command:   spherecut experiment run cut_fuzz --out DIR
#include "experiments/cut_fuzz/fuzz.hpp"
#include "experiments/cut_fuzz/solved.hpp"
#include "experiments/registered.hpp"
#include "src/output/figure.hpp"

#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

/// Cuts of organs with fissures, walls, a cavity and islands as precuts of a body that sags under its weight.
SolvedOutcome solve_all(const ExperimentContext& context) {
  const int blades_an_organ = context.quick ? 14 : 500; // 14: every kind once
  SolvedOutcome total;
  app::Table table({"organ", "blades", "solved", "refused", "warned", "beyond_size", "largest_in_sizes", "failures"});
  for (const FuzzOrgan& organ : solved_organs()) {
    const SolvedOutcome outcome = solve_cuts(organ, 0, blades_an_organ, context.out / "solved");
    table.add({organ.name, fmt::format("{}", outcome.blades), fmt::format("{}", outcome.solved),
               fmt::format("{}", outcome.refused), fmt::format("{}", outcome.warned), fmt::format("{}", outcome.beyond),
               fmt::format("{:.3g}", outcome.largest), fmt::format("{}", outcome.failures.size())});
    context.say(fmt::format("{}: {} blades, {} solved, {} refused, {} beyond the organ's size and said", organ.name,
                            outcome.blades, outcome.solved, outcome.refused, outcome.beyond));
    for (const std::string& failure : outcome.failures)
      context.say(failure);
    add(total, outcome);
  }
  app::Table reasons({"refusals", "reason"});
  for (const auto& [reason, count] : total.reasons)
    reasons.add({fmt::format("{}", count), reason});
  table.write(context.out / "solved.csv");
  reasons.write(context.out / "refusals.csv");
  return total;
}

} // namespace

std::vector<Check> run_cut_fuzz(const ExperimentContext& context) {
  const int blades_an_organ = context.quick ? 13 : 300; // 13: every kind once
  FuzzOutcome total;
  app::Table table({"organ", "blades", "stages", "opened", "severed", "refused", "most_pieces", "worst_volume",
                    "worst_piece_volume", "failures"});
  app::Figure figure{"Blades of each kind, all organs", "kind", "blades", false, false, {}};
  for (const FuzzOrgan& organ : fuzz_organs()) {
    const FuzzOutcome outcome = cut_fuzz(organ, 0, blades_an_organ);
    table.add({organ.name, fmt::format("{}", outcome.blades), fmt::format("{}", outcome.stages),
               fmt::format("{}", outcome.opened), fmt::format("{}", outcome.severed),
               fmt::format("{}", outcome.refused), fmt::format("{}", outcome.most_pieces),
               fmt::format("{:.1e}", outcome.worst_volume), fmt::format("{:.1e}", outcome.worst_piece),
               fmt::format("{}", outcome.failures.size())});
    context.say(fmt::format("{}: {} blades in {} stages, {} opened, {} severed, {} failures", organ.name,
                            outcome.blades, outcome.stages, outcome.opened, outcome.severed, outcome.failures.size()));
    for (const std::string& failure : outcome.failures)
      context.say(failure);
    add(total, outcome);
  }
  app::Series kinds{"blades", {}, {}, app::SeriesStyle::points};
  app::Table kind_table({"kind", "blades"});
  for (const auto& [kind, count] : total.kinds) {
    kinds.x.push_back(static_cast<double>(kinds.x.size() + 1));
    kinds.y.push_back(count);
    kind_table.add({kind, fmt::format("{}", count)});
  }
  figure.series.push_back(kinds);
  table.write(context.out / "organs.csv");
  kind_table.write(context.out / "kinds.csv");
  app::write_png(figure, context.out / "kinds.png");
  const SolvedOutcome solved = solve_all(context);
  return {{"cut_fuzz_blades", static_cast<double>(total.blades), ">=", context.quick ? 91.0 : 2000.0},
          {"cut_fuzz_failures", static_cast<double>(total.failures.size()), "<=", 0},
          {"cut_fuzz_refused", static_cast<double>(total.refused), "<=", 0},
          {"cut_fuzz_volume", total.worst_volume, "<=", 1e-9},
          {"cut_fuzz_piece_volume_grown_against_at_once", total.worst_piece, "<=", 1e-12},
          {"cut_fuzz_opened", static_cast<double>(total.opened) / total.blades, ">=", 0.5},
          {"cut_fuzz_solved_blades", static_cast<double>(solved.blades), ">=", context.quick ? 56.0 : 2000.0},
          {"cut_fuzz_solved_failures", static_cast<double>(solved.failures.size()), "<=", 0},
          {"cut_fuzz_solved", static_cast<double>(solved.solved) / solved.blades, ">=", 0.4},
          {"cut_fuzz_displacement_in_sizes", solved.largest, "<=", 1}};
}

} // namespace spherecut::experiments
