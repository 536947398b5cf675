// A device of one's own in the haptic loop: it is asked where it is and told a force, a thousand times a second. Here
// it sways 4 mm into a block and out again, in virtual time, so that the same numbers come out every time;
// app::run_realtime takes the same device.
#include <spherecut/src/live/virtual_loop.hpp>

#include <cmath>
#include <cstdio>

using namespace spherecut;

namespace {

class Swaying : public app::Device {
 public:
  // Both on the loop's thread: they must not allocate, lock or throw.
  app::DeviceState read(std::uint64_t tick) noexcept override {
    app::DeviceState state;
    state.tick = tick;
    state.time = 1e-3 * static_cast<double>(tick);
    state.position = {0, 0, 0.051 - 0.0025 * (1 - std::cos(2 * std::acos(-1.0) * state.time))};
    return state;
  }
  void apply(const Vector3& force) noexcept override { peak = std::fmax(peak, force.norm()); }

  double peak = 0; // N
};

const char* const scenario_text = R"(
[organ]
shape = "block"
size = [0.10, 0.10, 0.05]
[material]
young_modulus = 10000.0
poisson_ratio = 0.45
[[fixed]]
region = "box"
lower = [-0.06, -0.06, -0.001]
upper = [0.06, 0.06, 0.001]
[nodes]
fine_spacing = 0.006
[tool]
shape = "sphere_tip"
radius = 0.01
[tool.approach]
target = [0.0, 0.0, 0.05]
direction = [0.0, 0.0, -1.0]
depth = 0.004
)";

} // namespace

int main() try {
  const app::Scenario scenario = app::read_scenario_text("block.toml", scenario_text);
  app::HapticSimulation simulation(scenario);
  Swaying device;
  const std::uint64_t ticks = 1000, every = 10, later = 5; // a solve every 10 ticks, there 5 ticks later
  const auto records =
      app::run_virtual(scenario.haptics, simulation, device, app::regular_solves(ticks, every, later), ticks);
  std::printf("%zu ticks, %zu solves, at most %.3f N\n", records.ticks.size(), records.solves.size(), device.peak);
  return device.peak > 0.1 && records.ticks.back().force.norm() < 1e-6 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
