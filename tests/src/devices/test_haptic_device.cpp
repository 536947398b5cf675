// Devices and the hand-over between threads.
#include "src/haptics/contact_snapshot.hpp"
#include "src/haptics/device.hpp"
#include "src/haptics/triple_buffer.hpp"

#include "tests/support/allocation_counter.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;

namespace {

std::vector<PathPose> line(const Vector3& from, const Vector3& to, double duration) {
  return {{0, from, Eigen::Quaterniond::Identity()},
          {duration, to, Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Vector3::UnitX()))}};
}

} // namespace

TEST_CASE("A scripted path moves evenly between its poses and rests outside them") {
  ScriptedPath path({{0.1, {0, 0, 0}, Eigen::Quaterniond::Identity()},
                     {0.2, {1, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Vector3::UnitX()))},
                     {0.4, {1, 2, 0}, Eigen::Quaterniond::Identity()}},
                    1000);
  CHECK(path.read(0).position == Vector3(0, 0, 0));
  CHECK((path.read(150).position - Vector3(0.5, 0, 0)).norm() < 1e-12);
  CHECK(path.read(150).orientation.angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vector3::UnitX()))) <
        1e-7);
  CHECK((path.read(300).position - Vector3(1, 1, 0)).norm() < 1e-12);
  CHECK(path.read(5000).position == Vector3(1, 2, 0));
  CHECK(path.read(250).time == Approx(0.25));
  CHECK(path.read(250).tick == 250);
  CHECK_THROWS_AS(ScriptedPath({}, 1000), InputError);
  CHECK_THROWS_AS(ScriptedPath({PathPose{0}, PathPose{0}}, 1000), InputError);
  CHECK_THROWS_AS(ScriptedPath({PathPose{0}}, 0), InputError);
}

TEST_CASE("A free hand swings with the frequency and decay of its mass, spring and damper") {
  HandSettings settings;
  settings.mass = 0.2;
  settings.stiffness = 80;
  settings.damping = 0.4;
  settings.rides_path = false;
  SimulatedHand hand({{0, Vector3::Zero(), Eigen::Quaterniond::Identity()}}, settings, 1000);
  static_cast<void>(hand.read(0));
  hand.apply({0.8, 0, 0}); // a constant force from rest
  const double decay = settings.damping / (2 * settings.mass);
  const double frequency = std::sqrt(settings.stiffness / settings.mass - decay * decay);
  double worst = 0;
  for (std::uint64_t tick = 1; tick <= 1000; ++tick) {
    const double t = 1e-3 * static_cast<double>(tick);
    const double exact =
        0.01 * (1 - std::exp(-decay * t) * (std::cos(frequency * t) + decay / frequency * std::sin(frequency * t)));
    worst = std::max(worst, std::abs(hand.read(tick).position.x() - exact));
    hand.apply({0.8, 0, 0});
  }
  CHECK(worst < 0.02 * 0.01); // first order in a step of 0.1 ms
}

TEST_CASE("A hand's sensor rounds to its resolution and a delayed force acts late") {
  HandSettings settings;
  settings.resolution = 1e-4;
  settings.delay = 2;
  settings.rides_path = false;
  SimulatedHand hand({{0, Vector3::Zero(), Eigen::Quaterniond::Identity()}}, settings, 1000);
  static_cast<void>(hand.read(0));
  for (std::uint64_t tick = 1; tick <= 3; ++tick) {
    hand.apply({1, 0, 0});
    static_cast<void>(hand.read(tick));
    CHECK((hand.velocity().x() > 0) == (tick == 3));
  }
  for (std::uint64_t tick = 4; tick <= 40; ++tick) {
    hand.apply({1, 0, 0});
    const double x = hand.read(tick).position.x() / settings.resolution;
    CHECK(std::abs(x - std::round(x)) < 1e-9);
    CHECK(std::abs(hand.read(tick).position.x() - hand.position().x()) <= 0.51 * settings.resolution);
  }
  settings.mass = 0;
  CHECK_THROWS_AS(SimulatedHand({PathPose{0}}, settings, 1000), InputError);
  settings.mass = 1;
  settings.delay = 16;
  CHECK_THROWS_AS(SimulatedHand({PathPose{0}}, settings, 1000), InputError);
}

TEST_CASE("A hand's work is what it gives up of its own energy") {
  HandSettings settings;
  settings.damping = 0;
  settings.stiffness = 0;
  settings.rides_path = false;
  SimulatedHand hand({{0, Vector3::Zero(), Eigen::Quaterniond::Identity()}}, settings, 1000);
  static_cast<void>(hand.read(0));
  for (std::uint64_t tick = 1; tick <= 100; ++tick) {
    hand.apply({0, 0, 2});
    static_cast<void>(hand.read(tick));
  }
  const double kinetic = 0.5 * settings.mass * hand.velocity().squaredNorm();
  CHECK(hand.work() == Approx(-kinetic).epsilon(0.002));
}

TEST_CASE("Devices allocate nothing at a tick") {
  SimulatedHand hand(line({0, 0, 0}, {0, 0, 1}, 1), {}, 1000);
  ScriptedPath path(line({0, 0, 0}, {0, 0, 1}, 1), 1000);
  const std::size_t before = tests::allocations();
  for (std::uint64_t tick = 0; tick < 50; ++tick) {
    static_cast<void>(hand.read(tick));
    hand.apply({0, 0, 0.1});
    static_cast<void>(path.read(tick));
  }
  CHECK(tests::allocations() == before);
}

TEST_CASE("The newest value crosses a triple buffer whole and in order") {
  struct Value {
    std::uint64_t number = 0;
    std::array<std::uint64_t, 64> copies{};
  };
  TripleBuffer<Value> buffer;
  CHECK_FALSE(buffer.fetch());
  constexpr std::uint64_t last = 200'000;
  std::thread writer([&] {
    for (std::uint64_t n = 1; n <= last; ++n) {
      Value& value = buffer.back();
      value.number = n;
      value.copies.fill(n);
      buffer.publish();
    }
  });
  std::uint64_t seen = 0;
  bool torn = false;
  bool backwards = false;
  while (seen < last) {
    if (!buffer.fetch())
      continue;
    const Value& value = buffer.front();
    for (const std::uint64_t copy : value.copies)
      torn = torn || copy != value.number;
    backwards = backwards || value.number <= seen;
    seen = value.number;
  }
  writer.join();
  CHECK_FALSE(torn);
  CHECK_FALSE(backwards);
  CHECK_FALSE(buffer.waiting());
}

TEST_CASE("A snapshot holds the symmetric part of the compliance and the candidates nearest to the contact") {
  constexpr int nodes = most_candidates + 20;
  solvers::ContactPatch patch;
  solvers::ContactState state;
  for (int c = 0; c < nodes; ++c) {
    patch.nodes.push_back(c);
    patch.rest.emplace_back(0.001 * c, 0, 0);
    patch.normals.emplace_back(0, 0, 1);
    patch.spacings.push_back(0.001);
    state.nodal_forces.emplace_back(0, 0, -0.1 * c);
    state.active.push_back(c == nodes - 1 ? 1 : 0);
    state.bond.emplace_back(Vector3::Zero());
  }
  patch.compliance = MatrixX::Random(3 * nodes, 3 * nodes);
  patch.base_displacement = VectorX::Random(3 * nodes);
  state.displacement = VectorX::Random(3 * nodes);
  state.tool_force = {0, 0, 3};
  ContactSnapshot snapshot;
  const auto memory = [](const ContactSnapshot& s) {
    return std::vector<const void*>{s.displacement.data(), s.forces.data(), s.along.data(), s.bond.data(),
                                    s.active.data()};
  };
  const std::vector<const void*> allocated = memory(snapshot);
  fill(patch, state, {}, solvers::ContactCondition::frictionless, nullptr, snapshot);
  CHECK(memory(snapshot) == allocated);
  CHECK(snapshot.displacement.size() == most_candidates);
  CHECK(snapshot.forces.size() == most_candidates);
  CHECK(snapshot.along.size() == most_candidates);
  CHECK(snapshot.bond.size() == most_candidates);
  CHECK(snapshot.active.size() == most_candidates);
  REQUIRE(snapshot.count == most_candidates);
  CHECK(snapshot.condensed->rest[most_candidates - 1] == patch.rest.back()); // far, but in contact
  CHECK(snapshot.condensed->rest[most_candidates - 2] == patch.rest[most_candidates - 2]);
  CHECK(snapshot.force == state.tool_force);
  const int rows = 3 * snapshot.count;
  const Eigen::Map<const MatrixX> compliance(snapshot.condensed->compliance.data(), rows, rows);
  double worst = 0;
  for (int i = 0; i < rows - 3; ++i)
    for (int j = 0; j < rows - 3; ++j)
      worst = std::max(worst, std::abs(compliance(i, j) - 0.5 * (patch.compliance(i, j) + patch.compliance(j, i))));
  CHECK(worst < 1e-15);
  CHECK(snapshot.condensed->asymmetry > 0.5);
  const auto last = snapshot.condensed;
  ContactSnapshot next;
  fill(patch, state, {}, solvers::ContactCondition::frictionless, last, next);
  CHECK(next.condensed == last); // the same body: the reader's caches stay warm
  const int late = patch.nodes[most_candidates - 2];
  patch.compliance(3 * late, 3 * late) += 1e-9;
  fill(patch, state, {}, solvers::ContactCondition::frictionless, last, next);
  REQUIRE(next.condensed != last);
  CHECK(next.condensed->number != last->number);
  CHECK(next.condensed->compliance.size() == last->compliance.size());
  ContactSnapshot alone;
  fill(patch, state, {}, solvers::ContactCondition::frictionless, nullptr, alone);
  CHECK(alone.condensed->compliance == next.condensed->compliance);
  CHECK(alone.condensed->asymmetry == next.condensed->asymmetry);
  clear(snapshot);
  CHECK(memory(snapshot) == allocated);
  CHECK(snapshot.count == 0);
  CHECK(snapshot.force.norm() == 0);
}
