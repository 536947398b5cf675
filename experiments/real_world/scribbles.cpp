// A blade in the hand scribbles over a block, stroke upon stroke through what it has cut before. Whatever it draws, the
// next solve comes within a second, no piece comes off that is no piece, and a stroke that cuts nothing says why.
#include "experiments/real_world/live_situations.hpp"
#include "experiments/support/haptic_motions.hpp"
#include "src/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <random>
#include <utility>

namespace spherecut::experiments::real_world {
namespace {

constexpr double scribble_top = 0.030;  // m, of the block
constexpr double scribble_speed = 0.05; // m/s
constexpr double scribble_spacing = 0.008;
constexpr int scribbles_a_body = 20;

app::Scenario scribbled_block() {
  app::Scenario scenario;
  scenario.file = "scribbled_block";
  scenario.title = "Scribbles on a block";
  scenario.organ.shape = app::BlockOrgan{Vector3(0.06, 0.06, scribble_top)};
  scenario.material = {10'000, 0.3, 1000};
  scenario.fixed = {{"base", Plane{Vector3::UnitZ(), 0.0005}}};
  scenario.nodes.fine_spacing = scenario.cut.front_spacing = scribble_spacing;
  scenario.nodes.coarse_spacing = 0.014;
  app::BladeSettings& blade = scenario.blade.emplace();
  blade.edge = {{0, 0, 0}, {0, 0, 0.03}};
  blade.edge_radius = 1e-4;
  blade.path = {{0, {0, -0.05, 0.02}, Vector3::Zero()}, {1, {0, -0.045, 0.02}, Vector3::Zero()}};
  return scenario;
}

struct ScribbleAccount {
  double longest = 0;        // s, of a solve
  double smallest_piece = 1; // of the block's volume
  int scribbles = 0, silent = 0, refused = 0, cut = 0;
};

/// Scribbles on one body until there are enough of them.
void scribble_on(std::uint64_t seed, int count, ScribbleAccount& account) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11U) * 0x1p-53;
  };
  std::size_t told = 0;
  app::HapticSimulation simulation(scribbled_block(), [&](const std::string&) { ++told; });
  app::ContactSnapshot snapshot;
  std::uint64_t tick = 0, sequence = 0;
  bool prepared = false;
  double area = 0;
  const double volume = 0.06 * 0.06 * scribble_top;
  int reasons = 0;
  const auto solve_at = [&](const Vector3& x) {
    tick += 10;
    const app::DeviceState state{tick, 1e-3 * static_cast<double>(tick),
                                 x,    Eigen::Quaterniond::Identity(),
                                 true, static_cast<std::uint16_t>(app::HandMode::blade)};
    if (!std::exchange(prepared, true))
      simulation.prepare(state);
    const app::SolveRecord record = app::solve_recording(
        simulation, state, {++sequence, tick, app::SolveEvent::never, 0, simulation.recondensed(), false}, snapshot);
    account.longest = std::max(account.longest, record.seconds);
    reasons += record.failed ? 1 : 0;
    area = record.failed ? area : std::max(area, record.cut_area);
    if (!record.failed && simulation.result().cut)
      for (const double piece : simulation.result().cut->volumes)
        account.smallest_piece = std::min(account.smallest_piece, piece / volume);
  };
  for (int i = 0; i < count; ++i) {
    ++account.scribbles;
    const double depth = uniform(0.004, 0.014);
    std::vector<Vector3> corners{{uniform(-0.04, 0.04), -0.04, scribble_top - depth}};
    const int strokes = 2 + static_cast<int>(random() % 5);
    for (int k = 0; k < strokes; ++k)
      corners.emplace_back(uniform(-0.028, 0.028), uniform(-0.028, 0.028), scribble_top - depth);
    corners.emplace_back(uniform(-0.04, 0.04), 0.04, scribble_top - depth);
    const double before = area;
    const int reasons_before = reasons;
    const std::size_t told_before = told, warned_before = simulation.session().warnings().size();
    solve_at({corners.front().x(), corners.front().y(), scribble_top + 0.02});
    for (std::size_t c = 1; c < corners.size(); ++c) {
      const Vector3 way = corners[c] - corners[c - 1];
      const int steps = std::max(1, static_cast<int>(std::ceil(way.norm() / (0.010 * scribble_speed))));
      const int every = std::max(1, steps / 12);
      for (int s = every; s < steps; s += every)
        solve_at(corners[c - 1] + static_cast<double>(s) / steps * way);
      solve_at(corners[c]);
    }
    solve_at({corners.back().x(), corners.back().y(), scribble_top + 0.02});
    const bool cut = area > before + 1e-9;
    const bool said =
        reasons > reasons_before || told > told_before || simulation.session().warnings().size() > warned_before;
    account.cut += cut ? 1 : 0;
    account.refused += reasons > reasons_before ? 1 : 0;
    account.silent += cut || said ? 0 : 1;
  }
}

} // namespace

std::vector<Check> scribbles(const ExperimentContext& context) {
  ScribbleAccount account;
  const int wanted = context.quick ? 8 : 10'000;
  for (std::uint64_t seed = 1; account.scribbles < wanted; ++seed) {
    scribble_on(seed, std::min(scribbles_a_body, wanted - account.scribbles), account);
    if (context.quick || seed % 10 == 0)
      context.say(fmt::format(
          "{} scribbles: {} cut, {} refused in words, {} silent; longest solve {:.2f} s, smallest piece {:.2g} of "
          "the block",
          account.scribbles, account.cut, account.refused, account.silent, account.longest, account.smallest_piece));
  }
  std::vector<Check> checks;
  if (!context.quick) // beside other programs a clock tells little
    checks.push_back({"scribbles_longest_solve_s", account.longest, "<=", 1});
  checks.push_back({"scribbles_smallest_piece", account.smallest_piece, ">=", 1e-6});
  checks.push_back({"scribbles_silent", static_cast<double>(account.silent), "<=", 0});
  checks.push_back({"scribbles_that_cut", static_cast<double>(account.cut), ">=", 1});
  return checks;
}

} // namespace spherecut::experiments::real_world
