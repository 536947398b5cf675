// Problem:   a ball presses, taps, slides and swings on a block, and rests on one while a blade cuts it beside the
// ball.
//            The body is solved 30, 100 and 300 times a second, each solve taking the whole interval; between, the
//            force is held, extrapolated in time (the paper), or taken from the condensed contact at every tick.
// Reference: the body solved at every tick of 1 ms.
// Command:   spherecut experiment run extrapolation --out DIR
#include "experiments/registered.hpp"

#include "experiments/support/haptic_motions.hpp"
#include "src/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {
namespace {

using app::ForceModelKind;
using solvers::Method;

constexpr std::array<ForceModelKind, 3> models{ForceModelKind::hold, ForceModelKind::linear_in_time,
                                               ForceModelKind::tangent};

struct Case {
  Method method;
  HapticMotion motion;
  std::vector<app::SolvedForce> solved;
  double peak = 0; // N
};

/// Errors over the peak by model, in the order of `models`.
struct Outcome {
  std::array<double, 3> rms{}, largest{};
};

Outcome run_case(const Case& one, int solve_rate, std::vector<std::vector<app::TickRecord>>& ticks) {
  Outcome outcome;
  const auto count = static_cast<std::uint64_t>(one.solved.size());
  const auto period = static_cast<std::uint64_t>(std::lround(1000.0 / solve_rate));
  for (std::size_t m = 0; m < models.size(); ++m) {
    app::HapticSettings settings;
    settings.model = models[m];
    settings.passivity = false;
    app::HapticSimulation simulation(haptic_block(one.motion, one.method));
    app::ScriptedPath device(one.motion.path, settings.rate);
    ticks.push_back(
        app::run_virtual(settings, simulation, device, app::regular_solves(count, period, period), count).ticks);
    const ForceError error = force_error(ticks.back(), one.solved);
    outcome.rms[m] = error.rms / one.peak;
    outcome.largest[m] = error.largest / one.peak;
  }
  return outcome;
}

Case solve_case(Method method, const HapticMotion& motion) {
  Case one{method, motion, {}, 0};
  app::ScriptedPath device(motion.path, 1000);
  std::vector<app::TickRecord> ticks;
  for (std::uint64_t tick = 0; tick < static_cast<std::uint64_t>(std::lround(1000 * motion.duration)); ++tick)
    ticks.emplace_back().device = device.read(tick);
  app::HapticSimulation simulation(haptic_block(motion, method));
  one.solved = app::solve_recorded(simulation, ticks, 1);
  for (const app::SolvedForce& force : one.solved)
    one.peak = std::max(one.peak, force.force.norm());
  return one;
}

} // namespace

std::vector<Check> run_extrapolation(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table({"method", "motion", "solves_per_s", "peak_N", "hold_rms", "linear_in_time_rms", "tangent_rms",
                    "hold_largest", "linear_in_time_largest", "tangent_largest"});
  const std::vector<Method> methods{Method::galerkin, Method::collocation};
  for (const Method method : methods)
    for (const HapticMotion& motion : haptic_motions()) {
      if (context.quick && (motion.cut || (motion.name == "sine" && method == Method::collocation)))
        continue;
      const Case one = solve_case(method, motion);
      const std::string name = fmt::format("{}_{}", solvers::to_string(method), motion.name);
      for (const int rate : {30, 100, 300}) {
        if (context.quick && rate != 100)
          continue;
        std::vector<std::vector<app::TickRecord>> ticks;
        const Outcome outcome = run_case(one, rate, ticks);
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
