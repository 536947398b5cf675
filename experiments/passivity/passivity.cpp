// Problem:   a light hand, one tick late, with a sensor of 55 um, lets the ball sink onto blocks of growing stiffness
//            and holds it there. Sampling, delay and rounding feed energy to it. Does the loop give more than it got?
//            And where a second hand beside the first cuts the block with a blade, both solved at once?
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

/// What both hands have felt: one presses the ball and lets go, the other draws a blade down through the block beside
/// it.
struct BothHands {
  double lowest = 0, peak = 0;             // J, N, of the ball
  double blade_lowest = 0, blade_peak = 0; // likewise
  double allowance = 0;                    // J
  double area = 0;                         // m2, that is cut
};

BothHands run_both_hands() {
  constexpr double top = 0.030, duration = 2; // m, s
  const auto pose = [](double time, double x, double z) {
    return app::PathPose{time, Vector3(x, 0, z), Eigen::Quaterniond::Identity()};
  };
  HapticMotion motion{"both hands", duration, {}};
  motion.path = {pose(0, -0.012, top + 0.002), pose(0.4, -0.012, top - 0.005), pose(1.6, -0.012, top - 0.005),
                 pose(duration, -0.012, top + 0.004)};
  app::Scenario scenario = haptic_block(motion, Method::galerkin);
  scenario.toughness = 10; // J/m2
  scenario.nodes.fine_spacing = scenario.cut.front_spacing = 0.004;
  app::BladeSettings& blade = scenario.blade.emplace();
  blade.edge = {{0, -0.04, 0}, {0, 0.04, 0}};
  blade.edge_radius = 1e-4;
  const std::vector<app::PathPose> way{pose(0, 0.016, top + 0.001), pose(1.5, 0.016, top - 0.014),
                                       pose(duration, 0.016, top + 0.004)};
  for (const app::PathPose& at : way)
    blade.path.push_back({at.time, at.position, Vector3::Zero()});
  app::HapticSettings settings;
  settings.limits.delay = 1;
  settings.hand = {.mass = 0.08, .stiffness = 300, .damping = 2, .resolution = settings.limits.resolution, .delay = 1};
  app::HapticSimulation simulation(scenario);
  app::SimulatedHand first(motion.path, settings.hand, settings.rate);
  app::SimulatedHand second(way, settings.hand, settings.rate);
  app::VirtualOptions options;
  options.second = &second;
  const auto count = static_cast<std::uint64_t>(settings.rate * duration);
  const app::LoopRecords records =
      app::run_virtual(settings, simulation, first, app::regular_solves(count, 30, 30), count, options);
  BothHands both;
  both.allowance = app::PassivityControl(settings.limits, settings.rate, true).sampling_allowance();
  both.area = records.solves.back().cut_area;
  for (const app::TickRecord& tick : records.ticks) {
    both.lowest = std::min(both.lowest, tick.energy);
    both.peak = std::max(both.peak, tick.force.norm());
    if (!tick.second)
      continue;
    both.blade_lowest = std::min(both.blade_lowest, tick.second->energy);
    both.blade_peak = std::max(both.blade_peak, tick.second->force.norm());
  }
  return both;
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
  const BothHands both = run_both_hands();
  context.say(
      fmt::format("both hands: the ball {:.3g} N at most, lowest energy {:.2e} J; the blade {:.3g} N, {:.2e} J, "
                  "{:.3g} cm2 cut",
                  both.peak, both.lowest, both.blade_peak, both.blade_lowest, 1e4 * both.area));
  const double least = -1e-4 - both.allowance; // J
  checks.push_back({"both_hands_tool_lowest_energy", both.lowest, ">=", least});
  checks.push_back({"both_hands_blade_lowest_energy", both.blade_lowest, ">=", least});
  checks.push_back({"both_hands_tool_peak_N", both.peak, ">=", 0.1});
  checks.push_back({"both_hands_blade_peak_N", both.blade_peak, ">=", 0.1});
  checks.push_back({"both_hands_cut_cm2", 1e4 * both.area, ">=", 3});
  table.write(context.out / "passivity.csv");
  app::write_png(figure, context.out / "stiff.png");
  return checks;
}

} // namespace spherecut::experiments
