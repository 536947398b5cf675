// The tool's path stays 20 mm over the block; a device presses it 3 mm in. The force is that of a scenario whose path
// goes there.
#include "experiments/real_world/live_situations.hpp"
#include "experiments/support/haptic_motions.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::experiments::real_world {
namespace {

Vector3 force_at_place(const std::vector<Vector3>& path, const Vector3& place, solvers::Method method) {
  HapticMotion motion{"path", 1, {}};
  for (std::size_t i = 0; i < path.size(); ++i)
    motion.path.push_back({static_cast<double>(i), path[i], Eigen::Quaterniond::Identity()});
  app::HapticSimulation simulation(haptic_block(motion, method));
  app::ContactSnapshot snapshot;
  for (std::uint64_t tick = 0; tick <= 12; ++tick) {
    const Vector3 at = place + Vector3(0, 0, 0.001 * static_cast<double>(12 - tick));
    const app::DeviceState state{tick, 1e-3 * static_cast<double>(tick), at, Eigen::Quaterniond::Identity()};
    if (tick == 0)
      simulation.prepare(state);
    simulation.solve(state, 0, snapshot);
  }
  return snapshot.force;
}

} // namespace

std::vector<Check> device_elsewhere(const ExperimentContext& context) {
  std::vector<Check> checks;
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    double worst = 0;
    for (const Vector3& place : {Vector3(0, 0, 0.027), Vector3(-0.012, 0.008, 0.027)}) {
      const Vector3 aside = force_at_place({{0, 0, 0.05}, {0.02, 0, 0.05}}, place, method);
      const Vector3 there = force_at_place({place + Vector3(0, 0, 0.01), place}, place, method);
      worst = std::max(worst, (aside - there).norm() / there.norm());
      context.say(fmt::format(
          "{}: a device 3 mm deep at [{:g}, {:g}] m, where no path goes: {:.4f} N; where one does: {:.4f} N",
          solvers::to_string(method), place.x(), place.y(), aside.norm(), there.norm()));
    }
    checks.push_back({fmt::format("device_elsewhere_{}", solvers::to_string(method)), worst, "<=", 0.05});
    if (context.quick)
      break;
  }
  return checks;
}

} // namespace spherecut::experiments::real_world
