// Problem:   a light hand, one tick late, with a sensor of 55 um, lets the ball sink onto blocks of growing stiffness
//            and holds it there. Sampling, delay and rounding feed energy to it. Does the loop give more than it got?
// Reference: a passive port: the energy put in by the hand never falls below zero, but for what the sensor's rounding
//            can feign.
// Command:   spherecut experiment run passivity --out DIR
#include "experiments/registered.hpp"

#include "experiments/support/haptic_motions.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {
namespace {

using solvers::Method;

constexpr double pull = 1.2;          // N, of the hand at rest
constexpr double hand_stiffness = 60; // N/m

struct Outcome {
  double lowest = 0;    // J, energy at the port
  double unrest = 0;    // m, between the extremes of the last 0.3 s
  double stiffness = 0; // N/m, at rest: 1.5 force / depth, as of a ball on a half-space
  double allowance = 0; // J
  std::vector<app::TickRecord> ticks;
};

/// E for which a ball of 10 mm under `pull` has the stiffness `wanted` N/m [Hertz 1881].
double modulus(double wanted) {
  const double depth = 1.5 * pull / wanted;
  return 0.91 * wanted / (2 * std::sqrt(0.010 * depth));
}

Outcome run_hand(Method method, double wanted, bool controlled) {
  HapticMotion motion{"hand", 1.5, {}};
  const double top = 0.030;
  const auto pose = [&](double time, double height) {
    return app::PathPose{time, Vector3(0, 0, top + height), Eigen::Quaterniond::Identity()};
  };
  motion.path = {pose(0, 0.001), pose(0.05, 0.001), pose(0.25, -pull / hand_stiffness)};
  app::Scenario scenario = haptic_block(motion, method);
  scenario.material.young_modulus = modulus(wanted);
  app::HapticSettings settings;
  settings.passivity = controlled;
  settings.limits.delay = 1;
  settings.limits.slew = 1e4;
  settings.hand = {
      .mass = 0.08, .stiffness = hand_stiffness, .damping = 0.5, .resolution = settings.limits.resolution, .delay = 1};
  app::HapticSimulation simulation(scenario);
  app::SimulatedHand hand(motion.path, settings.hand, settings.rate);
  const auto count = static_cast<std::uint64_t>(settings.rate * motion.duration);
  Outcome outcome;
  outcome.ticks = app::run_virtual(settings, simulation, hand, app::regular_solves(count, 10, 10), count).ticks;
  outcome.allowance = app::PassivityControl(settings.limits, settings.rate, true).sampling_allowance();
  double low = 1;
  double high = -1;
  for (const app::TickRecord& tick : outcome.ticks) {
    outcome.lowest = std::min(outcome.lowest, tick.energy);
    if (tick.device.time > motion.duration - 0.3) {
      low = std::min(low, tick.device.position.z());
      high = std::max(high, tick.device.position.z());
    }
  }
  outcome.unrest = high - low;
  outcome.stiffness = 1.5 * pull / std::max(1e-5, top - 0.5 * (low + high));
  return outcome;
}

} // namespace

std::vector<Check> run_passivity(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table(
      {"method", "wanted_N_per_m", "controller", "stiffness_N_per_m", "lowest_energy_J", "allowance_J", "unrest_mm"});
  app::Figure figure;
  figure.title = "A light hand on a block three times stiffer than the device's limit";
  figure.x_label = "time [s]";
  figure.y_label = "height of the tool over the block [mm]";
  const double limit = app::DeviceLimits{}.stiffness;
  for (const Method method : {Method::galerkin, Method::collocation})
    for (const double share : {0.25, 0.5, 1.0, 3.0})
      for (const bool controlled : {false, true}) {
        if (context.quick && (share < 1 || (method == Method::collocation && (share > 1 || !controlled))))
          continue;
        const Outcome outcome = run_hand(method, share * limit, controlled);
        const std::string name =
            fmt::format("{}_{:.0f}_{}", solvers::to_string(method), share * limit, controlled ? "controlled" : "free");
        context.say(
            fmt::format("{}: {:.0f} N/m at rest, lowest energy {:.2e} J (allowance {:.1e} J), moves by {:.3f} mm "
                        "at the end",
                        name, outcome.stiffness, outcome.lowest, outcome.allowance, 1e3 * outcome.unrest));
        table.add({std::string(solvers::to_string(method)), fmt::format("{:.0f}", share * limit),
                   controlled ? "on" : "off", fmt::format("{:.1f}", outcome.stiffness),
                   fmt::format("{:.3e}", outcome.lowest), fmt::format("{:.3e}", outcome.allowance),
                   fmt::format("{:.4f}", 1e3 * outcome.unrest)});
        if (controlled && share <= 1)
          checks.push_back({name + "_lowest_energy", outcome.lowest, ">=", -1e-4 * (1 + outcome.allowance / 1e-4)});
        if (!controlled && share > 1)
          checks.push_back({name + "_is_unstable_mm", 1e3 * outcome.unrest, ">=", 1});
        if (method == Method::galerkin && share > 1) {
          app::Series series{controlled ? "with the controller" : "without", {}, {}, app::SeriesStyle::lines};
          for (const app::TickRecord& tick : outcome.ticks) {
            series.x.push_back(tick.device.time);
            series.y.push_back(1e3 * (tick.device.position.z() - 0.030));
          }
          figure.series.push_back(series);
        }
      }
  table.write(context.out / "passivity.csv");
  app::write_png(figure, context.out / "stiff.png");
  return checks;
}

} // namespace spherecut::experiments
