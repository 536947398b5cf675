// Problem:   a ball presses, taps, slides with and without friction, and swings on a block, and swings on one while a
//            blade cuts into its side. The body is solved 30, 100 and 300 times a second, each solve taking the whole
//            interval; between, the force is held, extrapolated in time (the paper), or taken from the condensed
//            contact at every tick.
// Reference: the body solved at every tick of 1 ms.
// Command:   spherecut experiment run extrapolation --out DIR
#include "experiments/registered.hpp"

#include "experiments/support/haptic_motions.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {
namespace {

using app::ForceModelKind;
using solvers::Method;

constexpr std::array<ForceModelKind, 3> models{ForceModelKind::hold, ForceModelKind::linear_in_time,
                                               ForceModelKind::tangent};

/// Errors over the peak by model, in the order of `models`.
struct Outcome {
  std::array<double, 3> rms{}, largest{};
  std::array<std::vector<app::TickRecord>, 3> ticks;
};

Outcome run_models(const SolvedMotion& one, int solve_rate) {
  Outcome outcome;
  const std::vector<app::LoopRecords> records = run_motion(one, {models.begin(), models.end()}, solve_rate);
  for (std::size_t m = 0; m < models.size(); ++m) {
    outcome.ticks[m] = records[m].ticks;
    const app::ModelError error = app::model_error(outcome.ticks[m], one.solved);
    outcome.rms[m] = error.rms / one.peak;
    outcome.largest[m] = error.largest / one.peak;
  }
  return outcome;
}

void draw(const SolvedMotion& one, const Outcome& outcome, const std::filesystem::path& file) {
  app::Figure figure;
  figure.title = "Force while " + one.motion.name + "ping, 100 solves a second";
  figure.x_label = "time [s]";
  figure.y_label = "force on the tool [N]";
  app::Series solved{"solved at every tick", {}, {}, app::SeriesStyle::points};
  std::array<app::Series, 3> felt;
  for (std::size_t m = 0; m < models.size(); ++m)
    felt[m] = {std::string(app::to_string(models[m])), {}, {}, app::SeriesStyle::lines};
  for (const app::SolvedForce& force : one.solved) {
    const double time = 1e-3 * static_cast<double>(force.tick);
    if (time > 0.5) // two taps
      break;
    if (force.tick % 5 == 0) {
      solved.x.push_back(time);
      solved.y.push_back(force.force.norm());
    }
    for (std::size_t m = 0; m < models.size(); ++m) {
      felt[m].x.push_back(time);
      felt[m].y.push_back(outcome.ticks[m][force.tick].tissue.norm());
    }
  }
  figure.series = {felt[0], felt[1], felt[2], solved};
  app::write_png(figure, file);
}

} // namespace

std::vector<Check> run_extrapolation(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table({"method", "motion", "solves_per_s", "peak_N", "hold_rms", "linear_in_time_rms", "tangent_rms",
                    "hold_largest", "linear_in_time_largest", "tangent_largest"});
  const std::vector<Method> methods{Method::galerkin, Method::collocation};
  for (const Method method : methods)
    for (const HapticMotion& motion : haptic_motions()) {
      if (context.quick && motion.name != "tap" && (motion.name != "slide" || method == Method::collocation))
        continue;
      const SolvedMotion one = solve_motion(method, motion);
      const std::string name = fmt::format("{}_{}", solvers::to_string(method), motion.name);
      for (const int rate : {30, 100, 300}) {
        if (context.quick && rate != 100)
          continue;
        const Outcome outcome = run_models(one, rate);
        if (motion.name == "tap" && rate == 100 && method == Method::galerkin)
          draw(one, outcome, context.out / "tap.png");
        const auto& rms = outcome.rms;
        context.say(fmt::format("{} at {} Hz, peak {:.3g} N: hold {:.2f} %, linear {:.2f} %, tangent {:.3f} %; largest "
                                "{:.1f} / {:.1f} / {:.2f} %",
                                name, rate, one.peak, 100 * rms[0], 100 * rms[1], 100 * rms[2],
                                100 * outcome.largest[0], 100 * outcome.largest[1], 100 * outcome.largest[2]));
        table.add({std::string(solvers::to_string(method)), motion.name, fmt::format("{}", rate),
                   fmt::format("{:.4g}", one.peak), fmt::format("{:.5f}", rms[0]), fmt::format("{:.5f}", rms[1]),
                   fmt::format("{:.5f}", rms[2]), fmt::format("{:.5f}", outcome.largest[0]),
                   fmt::format("{:.5f}", outcome.largest[1]), fmt::format("{:.5f}", outcome.largest[2])});
        const std::string at = fmt::format("{}_{}", name, rate);
        if (rate == 100)
          checks.push_back({at + "_tangent_rms", rms[2], "<=", motion.cut ? 0.05 : 0.02});
        if (rms[0] > 0.02)
          checks.push_back({at + "_hold_over_tangent", rms[0] / rms[2], ">=", rate >= 100 ? 5.0 : 2.0});
        checks.push_back({at + "_tangent_minus_linear", rms[2] - rms[1], "<=", 0.002});
      }
    }
  table.write(context.out / "extrapolation.csv");
  return checks;
}

} // namespace spherecut::experiments
