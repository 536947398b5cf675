#include "experiments/support/haptic_motions.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace spherecut::experiments {
namespace {

constexpr double top = 0.030;    // m, of the block
constexpr double sample = 0.001; // s, of a path
constexpr double tick_rate = 1000;
constexpr double pi = std::numbers::pi;

/// Smooth step from 0 to 1 over 0 <= t <= 1.
double ease(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

HapticMotion motion_of(const std::string& name, double duration, const std::function<Vector3(double)>& below) {
  HapticMotion motion{name, duration, {}};
  const int samples = static_cast<int>(std::lround(duration / sample));
  for (int i = 0; i <= samples; ++i)
    motion.path.push_back({i * sample, Vector3(0, 0, top) + below(i * sample), Eigen::Quaterniond::Identity()});
  return motion;
}

/// In from 1 mm above, held at `depth` from 0.1 s on.
double entered(double t, double depth) {
  return 0.001 - (0.001 + depth) * ease(t / 0.1);
}

} // namespace

std::vector<HapticMotion> haptic_motions() {
  std::vector<HapticMotion> motions;
  motions.push_back(motion_of("cut", 0.6, [](double t) {
    return Vector3(0, 0, entered(t, 0.0025) + 0.0015 * std::sin(2 * pi * 4 * std::max(0.0, t - 0.1)));
  }));
  motions.back().cut = true;
  motions.push_back(motion_of(
      "press", 1.0, [](double t) { return Vector3(0, 0, 0.001 - 0.005 * (ease(t / 0.4) - ease((t - 0.6) / 0.4))); }));
  motions.push_back(motion_of("tap", 0.75, [](double t) { // speed 2 pi 4 / s 4 mm = 0.1 m/s
    return Vector3(0, 0, 0.001 - 0.004 * (1 - std::cos(2 * pi * 4 * t)) * 0.5 * 2 * 0.99);
  }));
  motions.push_back(motion_of("slide", 0.9, [](double t) {
    return Vector3(-0.008 + 0.016 * ease((t - 0.1) / 0.5), 0.001 * std::sin(20 * t), entered(t, 0.003));
  }));
  motions.push_back(motions.back());
  motions.back().name = "drag";
  motions.back().friction = 0.3;
  motions.push_back(motion_of("sine", 1.6, [](double t) { // frequency rises from 1 to 5 Hz; 3.2 mm at 5 Hz are 0.1 m/s
    const double s = std::max(0.0, t - 0.1);
    const double phase = 2 * pi * (s + 0.5 * 4 * s * s / 1.5);
    return Vector3(0, 0, entered(t, 0.0035) + 0.003 * std::sin(phase) * ease(s / 0.1));
  }));
  return motions;
}

app::Scenario haptic_block(const HapticMotion& motion, solvers::Method method) {
  app::Scenario scenario;
  scenario.file = "haptic_block";
  scenario.title = "Ball on a block, " + motion.name;
  scenario.organ.shape = app::BlockOrgan{Vector3(0.06, 0.06, top)};
  scenario.material = {10'000, 0.3, 1000};
  scenario.fixed = {{"base", Plane{Vector3::UnitZ(), 0.0005}}};
  scenario.nodes.fine_spacing = 0.0032;
  scenario.nodes.coarse_spacing = 0.012;
  scenario.nodes.fine_radius = 0.010;
  scenario.method.method = method;
  app::ToolSettings& tool = scenario.tool.emplace();
  tool.shape = topology::SphereTip{0.010};
  tool.step = motion.duration / 50;
  std::vector<app::PathPoint> path;
  for (const app::PathPose& pose : motion.path)
    path.push_back({pose.time, pose.position});
  tool.motion = path;
  if (motion.friction > 0) {
    scenario.contact.condition = solvers::ContactCondition::frictional;
    scenario.contact.friction = motion.friction;
  }
  if (motion.cut) { // an upright edge, 10 mm deep, comes in from the side of the block at 10 mm/s
    app::BladeSettings& blade = scenario.blade.emplace();
    blade.edge = {{0, 0, 0}, {0, 0, 0.014}};
    blade.edge_radius = 1e-4;
    blade.path = {{0.05, {0.014, -0.0305, top - 0.010}, Vector3::Zero()},
                  {0.6, {0.014, -0.025, top - 0.010}, Vector3::Zero()}};
    scenario.nodes.fine_spacing = scenario.cut.front_spacing = 0.004;
  }
  return scenario;
}

SolvedMotion solve_motion(solvers::Method method, const HapticMotion& motion) {
  SolvedMotion result{method, motion, {}, 0};
  app::ScriptedPath device(motion.path, tick_rate);
  std::vector<app::TickRecord> ticks;
  for (std::uint64_t tick = 0; tick < static_cast<std::uint64_t>(std::lround(tick_rate * motion.duration)); ++tick)
    ticks.emplace_back().device = device.read(tick);
  app::HapticSimulation simulation(haptic_block(motion, method));
  result.solved = app::solve_recorded(simulation, ticks, 1);
  for (const app::SolvedForce& force : result.solved)
    result.peak = std::max(result.peak, force.force.norm());
  return result;
}

std::vector<app::LoopRecords> run_motion(const SolvedMotion& motion, const std::vector<app::ForceModelKind>& models,
                                         int solve_rate) {
  const auto count = static_cast<std::uint64_t>(motion.solved.size());
  const auto period = static_cast<std::uint64_t>(std::lround(tick_rate / solve_rate));
  std::vector<app::HapticSettings> settings;
  for (const app::ForceModelKind model : models) {
    app::HapticSettings& one = settings.emplace_back();
    one.model = model;
    one.passivity = false;
    one.limits.force = one.limits.slew = 1e6;
  }
  app::HapticSimulation simulation(haptic_block(motion.motion, motion.method));
  app::ScriptedPath device(motion.motion.path, tick_rate);
  return app::run_virtual(settings, simulation, device, app::regular_solves(count, period, period), count);
}

} // namespace spherecut::experiments
