// A hand of 0.1 kg at a client of some rate presses a ball into a block, in virtual time: the energy at the client's
// own port, and the steps of the force it is sent.
#include "experiments/real_world/live_situations.hpp"
#include "experiments/support/haptic_motions.hpp"
#include "experiments/support/slow_client.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <utility>

namespace spherecut::experiments::real_world {
namespace {

constexpr double client_press_seconds = 6;

struct ClientOutcome {
  double lowest = 0, peak = 0, late_peak = 0; // J; N, in all and in the last second
  double step = 0, exact_step = 0;            // N a tick: of the force, of what is solved under the true hand
};

/// In and out of the block's top by 4 mm once a second.
HapticMotion client_strokes() {
  HapticMotion motion{"strokes", client_press_seconds, {}};
  for (int i = 0; i <= static_cast<int>(100 * client_press_seconds); ++i) {
    const double time = 0.01 * i;
    motion.path.push_back(
        {time, {0, 0, 0.032 - 0.003 * (1 - std::cos(2 * std::numbers::pi * time))}, Eigen::Quaterniond::Identity()});
  }
  return motion;
}

ClientOutcome press_as_client(const SlowClientSettings& client, bool controlled) {
  const HapticMotion motion = client_strokes();
  app::HapticSimulation simulation(haptic_block(motion, solvers::Method::galerkin));
  app::HapticSettings settings;
  settings.passivity = controlled;
  settings.limits.slew = 1e5;
  const app::HandSettings hand{.mass = 0.1, .stiffness = 300, .damping = 5, .resolution = settings.limits.resolution};
  SlowClient device(motion.path, hand, client, settings.rate);
  std::vector<Vector3> true_hand;
  const auto ticks = static_cast<std::uint64_t>(client_press_seconds * settings.rate);
  app::VirtualOptions options;
  options.on_tick = [&](const app::TickRecord&) { true_hand.push_back(device.hand().position()); };
  const app::LoopRecords records =
      app::run_virtual(settings, simulation, device, app::regular_solves(ticks, 10, 10), ticks, options);
  std::vector<app::TickRecord> exact = records.ticks;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    exact[i].device.position = true_hand[i];
    exact[i].device.client = {};
  }
  app::HapticSimulation again(haptic_block(motion, solvers::Method::galerkin));
  const std::vector<app::SolvedForce> solved = app::solve_recorded(again, exact, 4);
  ClientOutcome outcome;
  outcome.lowest = device.lowest_energy();
  for (std::size_t i = 1; i < records.ticks.size(); ++i) {
    const Vector3& force = records.ticks[i].force;
    outcome.step = std::max(outcome.step, (force - records.ticks[i - 1].force).norm());
    outcome.peak = std::max(outcome.peak, force.norm());
    if (i + 1000 >= records.ticks.size())
      outcome.late_peak = std::max(outcome.late_peak, force.norm());
  }
  for (std::size_t i = 1; i < solved.size(); ++i)
    outcome.exact_step = std::max(outcome.exact_step, (solved[i].force - solved[i - 1].force).norm() / 4);
  return outcome;
}

} // namespace

std::vector<Check> slow_clients(const ExperimentContext& context) {
  std::vector<Check> checks;
  const double allowance = app::PassivityControl({}, 1000, true).sampling_allowance();
  app::Table table(
      {"poses_a_second", "seed", "controller", "lowest_energy_J", "peak_N", "late_peak_N", "step_N", "exact_step_N"});
  const auto run = [&](double rate, std::uint64_t seed, bool controlled) {
    SlowClientSettings client;
    client.rate = rate;
    client.seed = seed;
    const ClientOutcome outcome = press_as_client(client, controlled);
    table.add({rate, static_cast<double>(seed), controlled ? 1.0 : 0.0, outcome.lowest, outcome.peak, outcome.late_peak,
               outcome.step, outcome.exact_step});
    context.say(fmt::format(
        "{:.0f} poses a second, controller {}: lowest energy {:.3f} mJ (allowance {:.3f}), peak {:.3f} N, in "
        "the last second {:.3f} N, largest step {:.1f} mN, of the solved force {:.1f} mN",
        rate, controlled ? "on" : "off", 1e3 * outcome.lowest, 1e3 * allowance, outcome.peak, outcome.late_peak,
        1e3 * outcome.step, 1e3 * outcome.exact_step));
    return outcome;
  };
  const std::vector<double> rates =
      context.quick ? std::vector<double>{250, 60} : std::vector<double>{1000, 500, 250, 100, 60};
  for (const double rate : rates) {
    double lowest = 0, excess = 0, late = 1;
    for (std::uint64_t seed = 1; seed <= (context.quick ? 1U : 3U); ++seed) {
      const ClientOutcome outcome = run(rate, seed, true);
      lowest = std::min(lowest, outcome.lowest);
      excess = std::max(excess, (outcome.step - outcome.exact_step) / outcome.peak);
      late = std::min(late, outcome.late_peak / outcome.peak);
    }
    const std::string name = fmt::format("client_{:.0f}", rate);
    checks.push_back({name + "_lowest_energy_mJ", 1e3 * lowest, ">=", -1e3 * allowance});
    checks.push_back({name + "_step_beyond_exact", excess, "<=", 0.02});
    checks.push_back({name + "_force_stays", late, ">=", 0.25});
  }
  checks.push_back({"client_30_late_force_N", run(30, 1, true).late_peak, "<=", 0});
  if (!context.quick)
    checks.push_back({"client_60_uncontrolled_mJ", 1e3 * run(60, 1, false).lowest, "<=", -1});
  table.write(context.out / "slow_clients.csv");
  return checks;
}

} // namespace spherecut::experiments::real_world
