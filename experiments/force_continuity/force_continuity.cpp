// Problem:   the motions of `extrapolation`, with onset and loss of contact, nodes that follow the tool, cut increments
//            and a hand-over at every solve. Does the force ever jump?
// Reference: the step that the force solved at every tick takes itself from one tick to the next.
// Command:   spherecut experiment run force_continuity --out DIR
#include "experiments/registered.hpp"

#include "experiments/support/haptic_motions.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::experiments {
namespace {

using app::ForceModelKind;
using solvers::Method;

double largest_step(const std::vector<app::SolvedForce>& solved) {
  double largest = 0;
  for (std::size_t i = 1; i < solved.size(); ++i)
    largest = std::max(largest, (solved[i].force - solved[i - 1].force).norm());
  return largest;
}

} // namespace

std::vector<Check> run_force_continuity(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table({"method", "motion", "model", "solves_per_s", "peak_N", "step_over_peak", "solved_step_over_peak",
                    "hand_over", "onset", "cut"});
  app::Figure figure;
  figure.title = "Force while sliding, 30 solves a second";
  figure.x_label = "time [s]";
  figure.y_label = "force on the tool [N]";
  for (const Method method : {Method::galerkin, Method::collocation})
    for (const HapticMotion& motion : haptic_motions()) {
      if (context.quick && motion.name != "tap" && (motion.name != "slide" || method == Method::collocation))
        continue;
      const SolvedMotion one = solve_motion(method, motion);
      const double exact = largest_step(one.solved) / one.peak;
      const std::vector models{ForceModelKind::hold, ForceModelKind::linear_in_time, ForceModelKind::tangent};
      for (const int rate : {30, 100, 300}) {
        if (context.quick && rate == 300)
          continue;
        const std::vector<app::LoopRecords> runs = run_motion(one, models, rate);
        for (std::size_t m = 0; m < models.size(); ++m) {
          const ForceModelKind model = models[m];
          const app::LoopRecords& records = runs[m];
          const app::ForceSteps steps = app::force_steps(records);
          const std::string name =
              fmt::format("{}_{}_{}_{}", solvers::to_string(method), motion.name, app::to_string(model), rate);
          context.say(fmt::format("{}: largest step {:.2f} % of the peak, of the solved force {:.2f} %; at hand-overs "
                                  "{:.2f}, onset {:.2f}, cuts {:.2f} %",
                                  name, 100 * steps.any / one.peak, 100 * exact, 100 * steps.hand_over / one.peak,
                                  100 * steps.onset / one.peak, 100 * steps.cut / one.peak));
          table.add({std::string(solvers::to_string(method)), motion.name, std::string(app::to_string(model)),
                     fmt::format("{}", rate), fmt::format("{:.4g}", one.peak),
                     fmt::format("{:.5f}", steps.any / one.peak), fmt::format("{:.5f}", exact),
                     fmt::format("{:.5f}", steps.hand_over / one.peak), fmt::format("{:.5f}", steps.onset / one.peak),
                     fmt::format("{:.5f}", steps.cut / one.peak)});
          if (model == ForceModelKind::tangent)
            checks.push_back({name + "_step", steps.any / one.peak, "<=", 0.02 + exact});
          if (method == Method::galerkin && motion.name == "slide" && rate == 30 &&
              model != ForceModelKind::linear_in_time) {
            app::Series felt{std::string(app::to_string(model)), {}, {}, app::SeriesStyle::lines};
            for (const app::TickRecord& tick : records.ticks) {
              felt.x.push_back(tick.device.time);
              felt.y.push_back(tick.tissue.norm());
            }
            figure.series.push_back(felt);
          }
        }
      }
      if (method == Method::galerkin && motion.name == "slide") {
        app::Series solved{"solved at every tick", {}, {}, app::SeriesStyle::lines};
        for (const app::SolvedForce& force : one.solved) {
          solved.x.push_back(1e-3 * static_cast<double>(force.tick));
          solved.y.push_back(force.force.norm());
        }
        figure.series.push_back(solved);
      }
    }
  table.write(context.out / "force_continuity.csv");
  app::write_png(figure, context.out / "slide.png");
  return checks;
}

} // namespace spherecut::experiments
