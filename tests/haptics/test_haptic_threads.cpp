// The tick between threads, for ThreadSanitizer: the sources it needs and no more are compiled into this binary.
#include "src/haptics/tick.hpp"
#include "src/haptics/triple_buffer.hpp"

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;

namespace {

/// A cube of 2 cm about the origin.
topology::SurfaceMesh cube() {
  topology::SurfaceMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.emplace_back(i % 2 == 0 ? -0.01 : 0.01, i / 2 % 2 == 0 ? -0.01 : 0.01, i / 4 == 0 ? -0.01 : 0.01);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// 25 candidates on the top face, each on a spring of its own whose stiffness differs from solve to solve.
void solve(const DeviceState& device, std::uint64_t sequence, ContactSnapshot& snapshot) {
  const double stiffness = 100 + static_cast<double>(sequence % 7);
  snapshot.count = 25;
  snapshot.sequence = sequence;
  snapshot.pose_tick = device.tick;
  snapshot.pose.point = device.position;
  snapshot.contact.point = {0, 0, 0.01};
  snapshot.reach = 0.02;
  snapshot.rest_sum = 1;
  CondensedContact condensed;
  condensed.compliance.resize(static_cast<std::size_t>(75 * 75));
  for (int c = 0; c < snapshot.count; ++c) {
    condensed.rest.emplace_back(0.001 * (c % 5 - 2), 0.001 * (c / 5 - 2), 0.01);
    condensed.normals.emplace_back(Vector3::UnitZ());
    condensed.base.emplace_back(Vector3::Zero());
    snapshot.displacement[c] = snapshot.forces[c] = snapshot.bond[c] = Vector3::Zero();
    snapshot.active[c] = 0;
    for (int i = 0; i < 3; ++i)
      condensed.compliance[static_cast<std::size_t>((3 * c + i) * 76)] = 1 / stiffness;
  }
  snapshot.condensed = numbered(std::move(condensed));
}

} // namespace

TEST_CASE("Ticks, solves and a viewer share nothing but what is handed over") {
  const topology::ToolShape tool = topology::SphereTip{0.004};
  const topology::ContactQuery organ(cube());
  HapticSettings settings;
  SimulatedHand hand({{0, {0, 0, 0.012}, Eigen::Quaterniond::Identity()},
                      {0.2, {0, 0, 0.008}, Eigen::Quaterniond::Identity()},
                      {0.4, {0.001, 0, 0.008}, Eigen::Quaterniond::Identity()}},
                     {}, settings.rate);
  HapticTick core(settings, tool, &organ);
  TripleBuffer<DeviceState> poses;
  auto snapshots = std::make_unique<TripleBuffer<ContactSnapshot>>();
  TripleBuffer<std::vector<double>> frames;
  std::atomic<bool> done{false};
  std::uint64_t solves = 0;

  std::thread simulation([&] {
    while (!done.load()) {
      if (!poses.fetch()) {
        std::this_thread::yield();
        continue;
      }
      solve(poses.front(), ++solves, snapshots->back());
      snapshots->publish();
      frames.back().assign(100, static_cast<double>(solves));
      frames.publish();
    }
  });
  std::uint64_t used = 0;
  bool in_order = true;
  double peak = 0;
  std::thread haptic([&] {
    for (std::uint64_t tick = 0; tick < 3000; ++tick) {
      const DeviceState state = hand.read(tick);
      if (tick == 0)
        core.start(state);
      poses.back() = state;
      poses.publish();
      // The path ends at tick 400, pressed in by 2 mm: a solve of a pose there is waited for once, so that there is a
      // force to speak of however late the simulation thread runs.
      bool fetched = snapshots->fetch();
      while (tick == 600 && (!fetched || snapshots->front().pose_tick < 400)) {
        std::this_thread::yield();
        fetched = snapshots->fetch() || fetched;
      }
      if (fetched)
        core.arrive(snapshots->front());
      const TickResult result = core.tick(state);
      in_order = in_order && result.sequence >= used;
      used = result.sequence;
      peak = std::max(peak, result.force.norm());
      hand.apply(result.force);
      if (tick % 8 == 0) // as a clock would
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    done.store(true);
  });
  bool whole = true;
  while (!done.load()) {
    if (frames.fetch())
      whole = whole && frames.front().front() == frames.front().back();
    std::this_thread::yield();
  }
  haptic.join();
  simulation.join();
  CHECK(used > 0);
  CHECK(used <= solves);
  CHECK(in_order);
  CHECK(whole);
  CHECK(peak > 0.1);
}
