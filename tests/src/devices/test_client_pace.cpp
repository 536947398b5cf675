// Clients slower than the loop: their rate, the way from pose to pose, and the energy of a hand at such a client.
#include "experiments/support/slow_client.hpp"
#include "src/haptics/tick.hpp"
#include "src/live/haptic_report.hpp"
#include "tests/support/allocation_counter.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;
using spherecut::experiments::SlowClient;
using spherecut::experiments::SlowClientSettings;

namespace {

/// A wall of `stiffness` N/m below z = 0.
void wall(double stiffness, ContactSnapshot& snapshot) {
  clear(snapshot);
  snapshot.count = 1;
  snapshot.displacement[0] = snapshot.forces[0] = snapshot.bond[0] = Vector3::Zero();
  snapshot.active[0] = 0;
  snapshot.reach = 1;
  snapshot.condition = solvers::ContactCondition::frictionless;
  CondensedContact condensed{0, {Vector3::Zero()}, {Vector3::UnitZ()}, {Vector3::Zero()}, {}, 0};
  for (std::size_t i = 0; i < 9; ++i)
    condensed.compliance.push_back(i % 4 == 0 ? 1 / stiffness : 0);
  snapshot.condensed = numbered(std::move(condensed));
}

/// In and out of the wall by 4 mm once a second.
std::vector<PathPose> strokes(double seconds) {
  std::vector<PathPose> path;
  for (int i = 0; i <= static_cast<int>(100 * seconds); ++i) {
    const double time = 0.01 * i;
    path.push_back(
        {time, {0, 0, 0.002 - 0.003 * (1 - std::cos(2 * std::numbers::pi * time))}, Eigen::Quaterniond::Identity()});
  }
  return path;
}

struct ClientOutcome {
  double lowest = 0, peak = 0, late_peak = 0; // J; N, in all and in the last second
  double step = 0, exact_step = 0;            // N, from tick to tick: of the force, of the wall under the true hand
  double measured = 0;
};

ClientOutcome press_as_client(const SlowClientSettings& client, double stiffness, bool controlled, double seconds = 8) {
  HapticSettings settings;
  settings.passivity = controlled;
  settings.limits.slew = 1e5;
  const topology::ToolShape shape = topology::FlatPunch{0.005, 0.05};
  HapticTick core(settings, shape, nullptr);
  ContactSnapshot snapshot;
  wall(stiffness, snapshot);
  core.arrive(snapshot);
  HandSettings light;
  light.mass = 0.1;
  light.stiffness = 300;
  light.damping = 5;
  light.resolution = settings.limits.resolution;
  SlowClient device(strokes(seconds), light, client, settings.rate);
  ClientOutcome outcome;
  double before = 0, exact_before = 0;
  const auto ticks = static_cast<std::uint64_t>(seconds * settings.rate);
  for (std::uint64_t tick = 0; tick < ticks; ++tick) {
    const double force = core.tick(device.read(tick)).force.z();
    device.apply({0, 0, force});
    const double exact = std::min(settings.limits.force, stiffness * std::max(0.0, -device.hand().position().z()));
    outcome.step = std::max(outcome.step, std::abs(force - std::exchange(before, force)));
    outcome.exact_step = std::max(outcome.exact_step, std::abs(exact - std::exchange(exact_before, exact)));
    outcome.peak = std::max(outcome.peak, force);
    if (tick + 1000 >= ticks)
      outcome.late_peak = std::max(outcome.late_peak, force);
  }
  outcome.lowest = device.lowest_energy();
  outcome.measured = device.pace().measured();
  return outcome;
}

} // namespace

TEST_CASE("A client of any rate, with jitter, loss and reordering, gets no energy, no steps, and its force for good") {
  const double allowance = PassivityControl({}, 1000, true).sampling_allowance();
  for (const double rate : {1000.0, 500.0, 250.0, 100.0, 60.0})
    for (const double stiffness : {200.0, 500.0})
      for (const std::uint64_t seed : {1, 2, 3}) {
        SlowClientSettings client;
        client.rate = rate;
        client.seed = seed;
        const ClientOutcome outcome = press_as_client(client, stiffness, true);
        INFO(rate << " poses a second, " << stiffness << " N/m, seed " << seed << ": lowest " << 1e3 * outcome.lowest
                  << " mJ, steps " << 1e3 * outcome.step << " mN, exact " << 1e3 * outcome.exact_step << " mN, peak "
                  << outcome.peak << " N, in the last second " << outcome.late_peak << " N");
        CHECK(outcome.lowest > -allowance);
        CHECK(outcome.peak > 0.3);
        CHECK(outcome.late_peak > 0.25 * outcome.peak); // it does not die away
        // What the sensor's rounding does to a reading comes over the time to the next.
        const double rounding = stiffness * DeviceLimits{}.resolution * std::min(rate, 500.0) / 1000;
        CHECK(outcome.step < 0.02 * outcome.peak + outcome.exact_step + rounding);
        CHECK(outcome.measured == Approx(rate).epsilon(0.1));
      }
}

TEST_CASE("Without the controller a slow client's hand takes energy out of a wall") {
  SlowClientSettings client;
  client.rate = 60;
  CHECK(press_as_client(client, 500, false).lowest < -5e-3);
}

TEST_CASE("Below 50 poses a second the force fades, and the reason is told") {
  SlowClientSettings client;
  client.rate = 40;
  client.jitter = 0;
  const ClientOutcome outcome = press_as_client(client, 500, true, 4);
  CHECK(outcome.late_peak == 0);
  CHECK(outcome.measured == Approx(40).epsilon(0.05));
  CHECK_THAT(pace_text({PaceKind::too_slow, 40}),
             Catch::Contains("force fades") && Catch::Contains("40 poses a second") && Catch::Contains("50 or more"));
  CHECK_THAT(pace_text({PaceKind::interpolated, 100}),
             Catch::Contains("100 poses a second") && Catch::Contains("10 ms late"));
}

TEST_CASE("A client of full rate whose poses come unevenly is led over two ticks, until they come evenly again") {
  constexpr std::uint64_t uneven = 600, even = 2000; // ticks
  ClientPace pace(1000);
  pace.begin();
  DeviceState state;
  double before = 0, largest = 0;
  for (std::uint64_t tick = 0; tick < uneven + even; ++tick) {
    state.tick = tick;
    const bool is_late = tick < uneven && tick % 8 == 0; // comes with the next
    if (!is_late)
      pace.take({0, 0, 1e-4 * static_cast<double>(tick)}, Eigen::Quaterniond::Identity(), tick);
    pace.lead(state);
    if (tick > 100 && tick < uneven) {
      CHECK(state.client.period == 2);
      largest = std::max(largest, state.position.z() - before);
    }
    before = state.position.z();
  }
  CHECK(largest < 1.6e-4); // not the two steps of a tick that takes two
  CHECK(pace.kind() == PaceKind::full);
  CHECK(state.client.period == 1);
}

TEST_CASE("A client of full rate is followed pose by pose, a slower one evenly and without allocations") {
  ClientPace full(1000);
  full.begin();
  DeviceState state;
  for (std::uint64_t tick = 0; tick < 100; ++tick) {
    state.tick = tick;
    full.take({0, 0, 1e-4 * static_cast<double>(tick)}, Eigen::Quaterniond::Identity(), tick);
    full.lead(state);
    CHECK(state.position.z() == 1e-4 * static_cast<double>(tick));
    CHECK(state.client.period == 1);
    CHECK(state.client.share == 1);
  }
  CHECK(full.kind() == PaceKind::full);
  ClientPace slow(1000);
  slow.begin();
  const std::size_t allocations = tests::allocations();
  double before = 0, largest = 0;
  for (std::uint64_t tick = 0; tick < 400; ++tick) {
    state.tick = tick;
    if (tick % 10 == 0)
      slow.take({0, 0, 1e-4 * static_cast<double>(tick)}, Eigen::Quaterniond::Identity(), tick);
    slow.lead(state);
    if (tick >= 40)
      largest = std::max(largest, state.position.z() - before);
    before = state.position.z();
  }
  CHECK(tests::allocations() == allocations);
  CHECK(largest == Approx(1e-4));
  CHECK(before == Approx(1e-4 * 390));
  CHECK(slow.kind() == PaceKind::interpolated);
  CHECK(slow.measured() == Approx(100));
  CHECK(state.client.period == 10);
  // Put somewhere else: there at once.
  state.tick = 400;
  slow.take({0, 0, 0.2}, Eigen::Quaterniond::Identity(), 400);
  slow.lead(state);
  CHECK(state.position.z() == 0.2);
}
