// A tick of the haptic loop: force models against the solve, hand-over, limits, allocation, energy of closed loops.
#include "src/haptics/tick.hpp"
#include "src/live/virtual_loop.hpp"

#include "tests/src/device_poses.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/allocation_counter.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;
using spherecut::tests::around;
using spherecut::tests::device_at;
using spherecut::tests::replaced;
using spherecut::tests::scenario_of;
using spherecut::tests::small_scenario;
using spherecut::tests::unturned;

namespace {

Scenario small(const std::string& method, const std::string& condition = "frictionless") {
  return scenario_of(small_scenario + "[method]\nname = \"" + method + "\"\n[contact]\ncondition = \"" + condition +
                     "\"\n");
}

/// A snapshot of one ball on one candidate whose compliance is a plain spring of `stiffness` N/m.
void spring(double stiffness, const Vector3& at, ContactSnapshot& snapshot) {
  clear(snapshot);
  snapshot.count = 1;
  snapshot.displacement[0] = snapshot.forces[0] = snapshot.bond[0] = Vector3::Zero();
  snapshot.active[0] = 0;
  snapshot.pose.point = at;
  snapshot.reach = 1;
  snapshot.condition = solvers::ContactCondition::frictionless;
  CondensedContact condensed{0, {at}, {Vector3::UnitZ()}, {Vector3::Zero()}, {}, 0};
  for (std::size_t i = 0; i < 9; ++i)
    condensed.compliance.push_back(i % 4 == 0 ? 1 / stiffness : 0);
  snapshot.condensed = numbered(std::move(condensed));
}

const topology::ToolShape punch = topology::FlatPunch{0.005, 0.05};

} // namespace

TEST_CASE("Between solves the tangent model gives the force that a solve would give") {
  const auto [method, bound] =
      GENERATE(std::pair<std::string, double>{"galerkin", 2e-4}, std::pair<std::string, double>{"collocation", 0.02});
  HapticSimulation simulation(small(method));
  simulation.prepare(device_at(0, around(0)));
  ContactSnapshot first;
  simulation.solve(device_at(0, around(0)), 0, first);
  const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
  model->solved(first);
  ContactSnapshot now;
  double peak = 0;
  double worst = 0;
  int rounds = 0;
  for (std::uint64_t tick = 1; tick <= 400; ++tick) {
    const DeviceState device = device_at(tick, around(tick));
    const ModelForce force = model->at(tool_pose(simulation.tool(), device), device.orientation, device.time);
    rounds += force.rounds;
    CHECK(force.converged);
    if (tick % 20 != 0)
      continue;
    simulation.solve(device, 0, now);
    REQUIRE_FALSE(now.resprinkled);
    peak = std::max(peak, now.force.norm());
    worst = std::max(worst, (now.force - force.force).norm());
    CHECK(force.sinking < 1e-6);
  }
  CHECK(peak > 0.05);
  CHECK(worst < bound * peak);
  CHECK(rounds < 1.5 * 400); // from where the motion goes on, most ticks take one; 1.8 from where it was
}

TEST_CASE("With friction the tangent model gives the force that solves give along the way, and takes energy") {
  const auto [method, bound] =
      GENERATE(std::pair<std::string, double>{"galerkin", 0.02}, std::pair<std::string, double>{"collocation", 0.04});
  HapticSimulation simulation(small(method, "frictional"));
  HapticSimulation plain(small(method));
  ContactSnapshot now;
  ContactSnapshot without;
  for (HapticSimulation* each : {&simulation, &plain}) {
    each->prepare(device_at(0, around(0)));
    each->solve(device_at(0, around(0)), 0, each == &plain ? without : now);
  }
  CHECK(now.friction == 0.3);
  const ContactSnapshot first = now;
  const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
  model->solved(first);
  double peak = 0;
  double worst = 0;
  double apart = 0; // from the force without friction
  double work = 0;  // of the hand, J
  Vector3 last_place = around(0);
  Vector3 last_force = first.force;
  for (std::uint64_t tick = 1; tick <= 800; ++tick) {
    const DeviceState device = device_at(tick, around(tick));
    const ModelForce force = model->at(tool_pose(simulation.tool(), device), device.orientation, device.time);
    if (tick > 400) // the second time around the contact has come to a cycle
      work -= 0.5 * (force.force + last_force).dot(device.position - last_place);
    last_place = device.position;
    last_force = force.force;
    simulation.solve(device, 0, now); // friction remembers its way: solved at every tick too
    if (tick % 20 != 0)
      continue;
    plain.solve(device, 0, without);
    REQUIRE_FALSE(now.resprinkled);
    peak = std::max(peak, now.force.norm());
    worst = std::max(worst, (now.force - force.force).norm());
    apart = std::max(apart, (now.force - without.force).norm());
  }
  CHECK(peak > 0.05);
  CHECK(worst < bound * peak);
  CHECK(apart > 0.1 * peak);
  CHECK(work > 1e-6);
}

TEST_CASE("The tangent model follows onset and loss of contact") {
  HapticSimulation simulation(small("galerkin"));
  const auto height = [](double depth) { return Vector3(0, 0, 0.03 - depth); };
  ContactSnapshot clear_of_it;
  simulation.prepare(device_at(0, height(-5e-4)));
  simulation.solve(device_at(0, height(-5e-4)), 0, clear_of_it);
  REQUIRE(clear_of_it.count > 0);
  const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
  model->solved(clear_of_it);
  const auto force = [&](double depth) { return model->at({height(depth), Vector3::UnitZ()}, unturned, 0).force; };
  CHECK(force(-1e-4).norm() == 0);
  ContactSnapshot deep;
  simulation.solve(device_at(1, height(1e-3)), 0, deep);
  for (int i = 0; i < 10; ++i)
    static_cast<void>(force(1e-4 * i));
  CHECK((force(1e-3) - deep.force).norm() < 1e-3 * deep.force.norm());
  for (int i = 10; i >= 0; --i)
    static_cast<void>(force(1e-4 * i));
  CHECK(force(-1e-5).norm() == 0);
}

TEST_CASE("A bonded contact goes with the tool and catches what it overtakes") {
  const auto method = GENERATE(as<std::string>(), "galerkin", "collocation");
  HapticSimulation simulation(small(method, "bonded"));
  const Vector3 start(0, 0, 0.0297);
  simulation.prepare(device_at(0, start));
  ContactSnapshot first;
  simulation.solve(device_at(0, start), 0, first);
  const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
  model->solved(first);
  ModelForce force;
  for (int i = 1; i <= 30; ++i)
    force = model->at({start + Vector3(4e-5 * i, 0, -4e-5 * i), Vector3::UnitZ()}, unturned, 0);
  ContactSnapshot last;
  for (std::uint64_t i = 1; i <= 30; ++i)
    simulation.solve(device_at(i, start + Vector3(4e-5, 0, -4e-5) * static_cast<double>(i)), 0, last);
  CHECK(last.force.x() < -0.01); // dragged along
  CHECK((force.force - last.force).norm() < 0.02 * last.force.norm());
  CHECK(force.active > 1);
}

TEST_CASE("What a hand drags along before the first solve is no energy that the controller takes from it") {
  HapticSimulation simulation(small("galerkin", "bonded"));
  const auto place = [](int tick) { return Vector3(4e-5 * tick, 0, 0.0297 - 4e-5 * tick); };
  simulation.prepare(device_at(0, place(0)));
  ContactSnapshot late;
  for (int tick = 0; tick <= 30; ++tick)
    simulation.solve(device_at(static_cast<std::uint64_t>(tick), place(tick)), 0, late);
  const HapticSettings settings;
  HapticTick core(settings, simulation.tool(), nullptr);
  double largest = 0, damping = 0;
  for (int tick = 0; tick < 150; ++tick) {
    if (tick == 30)
      core.arrive(late);
    // On its way, then at rest but for the last digit of the sensor.
    const Vector3 jitter(tick > 60 && tick % 8 < 2 ? settings.limits.resolution : 0, 0, 0);
    const TickResult result =
        core.tick(device_at(static_cast<std::uint64_t>(tick), place(std::min(tick, 60)) + jitter));
    largest = std::max(largest, result.tissue.norm());
    damping = std::max(damping, (result.force - result.softened * settings.limits.gain * result.tissue).norm());
  }
  CHECK(largest > 0.02);
  CHECK(damping < 0.01 * largest);
}

TEST_CASE("Around a closed loop at constant contact the tangent model gives no energy, symmetric or not") {
  const auto method = GENERATE(as<std::string>(), "galerkin", "collocation");
  HapticSimulation simulation(small(method));
  simulation.prepare(device_at(0, around(0)));
  ContactSnapshot snapshot;
  simulation.solve(device_at(0, around(0)), 0, snapshot);
  if (method == "collocation")
    CHECK(snapshot.condensed->asymmetry > 1e-4);
  const auto model = make_force_model(ForceModelKind::tangent, simulation.tool());
  model->solved(snapshot);
  double work = 0;
  double exchanged = 0;
  Vector3 before = Vector3::Zero();
  for (int i = 0; i <= 800; ++i) { // twice around; the first round settles the active set
    const ModelForce force = model->at({around(static_cast<std::uint64_t>(i)), Vector3::UnitZ()}, unturned, 0);
    if (i > 400) {
      const double part =
          -0.5 *
          (before + force.force).dot(around(static_cast<std::uint64_t>(i)) - around(static_cast<std::uint64_t>(i - 1)));
      work += part;
      exchanged += std::abs(part);
    }
    before = force.force;
  }
  CHECK(exchanged > 1e-5);
  CHECK(std::abs(work) < 2e-3 * exchanged);
}

TEST_CASE("The linear model goes on along the line through the last two solves, the hold model stays") {
  ContactSnapshot first;
  ContactSnapshot second;
  first.time = 0.01;
  first.force = {0, 0, 1};
  second.time = 0.02;
  second.force = {0, 0, 1.5};
  const auto linear = make_force_model(ForceModelKind::linear_in_time, punch);
  const auto hold = make_force_model(ForceModelKind::hold, punch);
  CHECK(linear->at({}, unturned, 0).force.norm() == 0);
  linear->solved(first);
  CHECK(linear->at({}, unturned, 0.018).force.z() == Approx(1));
  linear->solved(second);
  CHECK(linear->at({}, unturned, 0.026).force.z() == Approx(1.8));
  CHECK(linear->at({}, unturned, 10).force.z() == Approx(1.5 + 3 * 0.5)); // three intervals at most
  hold->solved(second);
  CHECK(hold->at({}, unturned, 10).force.z() == Approx(1.5));
  CHECK_THROWS_AS(force_model_from_string("cubic"), InputError);
}

TEST_CASE("A tick allocates nothing, with or without a new solve, in every model, and fetching changes nothing") {
  const auto kind = GENERATE(ForceModelKind::hold, ForceModelKind::linear_in_time, ForceModelKind::tangent);
  const auto condition = GENERATE(as<std::string>(), "frictionless", "frictional", "bonded");
  HapticSimulation simulation(small("galerkin", condition));
  simulation.prepare(device_at(0, around(0)));
  std::array<ContactSnapshot, 2> snapshots;
  simulation.solve(device_at(0, around(0)), 0, snapshots[0]);
  simulation.solve(device_at(30, around(30)), 0, snapshots[1]);
  HapticSettings settings;
  settings.model = kind;
  const topology::ContactQuery organ(simulation.session().organ().domain->surface());
  HapticTick core(settings, simulation.tool(), &organ);
  HapticTick fetching(settings, simulation.tool(), &organ);
  core.start(device_at(0, around(0)));
  fetching.start(device_at(0, around(0)));
  fetching.fetch(); // before anything has come
  std::array<Vector3, 100> forces;
  const std::size_t before = tests::allocations();
  for (std::uint64_t tick = 0; tick < 100; ++tick) {
    const DeviceState device = device_at(tick, around(tick));
    fetching.fetch();
    if (tick % 10 == 0) {
      core.arrive(snapshots[tick / 10 % 2]);
      fetching.arrive(snapshots[tick / 10 % 2]);
    }
    forces[tick] = core.tick(device).force;
    forces[tick] -= fetching.tick(device).force;
  }
  CHECK(tests::allocations() == before);
  for (const Vector3& difference : forces)
    CHECK(difference == Vector3::Zero());
}

TEST_CASE("At a new solve the force goes on from where it was and fades over in the given time") {
  HapticSettings settings;
  settings.hand_over = 0.01;
  settings.passivity = false;
  const topology::ToolShape shape = punch;
  HapticTick core(settings, shape, nullptr);
  ContactSnapshot soft;
  ContactSnapshot stiff;
  spring(400, Vector3::Zero(), soft);
  spring(500, Vector3::Zero(), stiff);
  const Vector3 deep(0, 0, -2e-3);
  core.arrive(soft);
  for (std::uint64_t tick = 0; tick < 20; ++tick)
    static_cast<void>(core.tick(device_at(tick, deep)));
  const Vector3 before = core.tick(device_at(20, deep)).force;
  CHECK(before.z() == Approx(0.8));
  core.arrive(stiff);
  double last = before.z();
  for (std::uint64_t tick = 21; tick < 31; ++tick) {
    const double force = core.tick(device_at(tick, deep)).force.z();
    CHECK(force - last == Approx(tick == 21 ? 0 : 0.02).margin(1e-9));
    last = force;
  }
  CHECK(core.tick(device_at(31, deep)).force.z() == Approx(1.0));
}

TEST_CASE("A mode that leaves the tool in the hand leaves the force, another hands it over") {
  const auto of = [](HandMode mode) { return static_cast<std::uint16_t>(mode); };
  const auto [from, to] = GENERATE(table<HandMode, HandMode>({{HandMode::usual, HandMode::probe},
                                                              {HandMode::probe, HandMode::usual},
                                                              {HandMode::probe, HandMode::grasper},
                                                              {HandMode::grasper, HandMode::probe},
                                                              {HandMode::usual, HandMode::blade},
                                                              {HandMode::blade, HandMode::usual}}));
  const auto late = GENERATE(as<std::uint64_t>(), 0, 1, 2, 7); // ticks, a solve
  const double stiffness = 100;
  const Vector3 deep(0, 0, -2e-3);
  const topology::ToolShape shape = punch;
  const HapticSettings settings;
  HapticTick core(settings, shape, nullptr);
  ContactSnapshot pressed;
  spring(stiffness, Vector3::Zero(), pressed);
  pressed.force = -stiffness * deep;
  std::array<ContactSnapshot, 2> snapshots;
  const std::uint64_t change = 600;
  const auto mode_at = [&](std::uint64_t tick) { return tick < change ? from : to; };
  const auto force_in = [&](HandMode mode) { return mode == HandMode::blade ? 0.0 : 0.2; };
  for (std::uint64_t tick = 0; tick < change + 100; ++tick) {
    DeviceState device = device_at(tick, deep);
    device.mode = of(mode_at(tick));
    if (tick >= late) { // a solve of the pose so many ticks ago
      ContactSnapshot& next = snapshots[tick % 2];
      const HandMode solved = mode_at(tick - late);
      next = pressed;
      if (solved == HandMode::blade)
        clear(next);
      next.mode = of(solved);
      core.arrive(next);
    }
    const double force = core.tick(device).force.z();
    if (tick == change - 1 || tick == change + 99)
      CHECK(force == Approx(force_in(mode_at(tick))).margin(1e-9));
    if (tick < change)
      continue;
    const auto since = static_cast<double>(tick - change);
    const double faded = std::min(1.0, (since + 1) / (settings.hand_over * settings.rate));
    const double soonest = force_in(from) + faded * (force_in(to) - force_in(from));
    CHECK(force >= std::min(force_in(from), soonest) - 1e-9);
    CHECK(force <= std::max(force_in(from), soonest) + 1e-9);
  }
}

TEST_CASE("The device of a scenario is the one that it names") {
  const std::vector<std::pair<std::string, HeldDevice>> devices = {{"script", HeldDevice::script},
                                                                   {"hand", HeldDevice::hand},
                                                                   {"bridge", HeldDevice::bridge},
                                                                   {"haply", HeldDevice::haply}};
  for (const auto& [name, device] : devices)
    CHECK(scenario_of(small_scenario + "[haptics]\ndevice = \"" + name + "\"\n").haptics.device == device);
}

TEST_CASE("Solves that come in every tick do not hold the force where it was") {
  HapticSettings settings;
  settings.model = ForceModelKind::hold;
  settings.passivity = false;
  const topology::ToolShape shape = punch;
  HapticTick core(settings, shape, nullptr);
  std::array<ContactSnapshot, 2> snapshots;
  const double rise = 0.01; // N a tick
  const double handed_over = settings.hand_over * settings.rate;
  for (std::uint64_t tick = 0; tick < 200; ++tick) {
    ContactSnapshot& next = snapshots[tick % 2];
    clear(next);
    next.force = {0, 0, rise * static_cast<double>(std::min<std::uint64_t>(tick, 100))};
    core.arrive(next);
    const double force = core.tick(device_at(tick, Vector3::Zero())).force.z();
    CHECK(force <= next.force.z() + 1e-12);
    CHECK(force >= next.force.z() - handed_over * rise - 1e-12); // as late as a hand-over takes
    if (tick == 199)
      CHECK(force == Approx(next.force.z()).epsilon(0.01));
  }
}

TEST_CASE("Gain, saturation and slew hold for the force that is sent, and a device that is gone is let go") {
  HapticSettings settings;
  settings.passivity = false;
  settings.limits.gain = 2;
  settings.limits.force = 1.5;
  settings.limits.slew = 100;
  const topology::ToolShape shape = punch;
  HapticTick core(settings, shape, nullptr);
  ContactSnapshot contact;
  spring(500, Vector3::Zero(), contact);
  core.arrive(contact);
  double last = 0;
  for (std::uint64_t tick = 0; tick < 100; ++tick) {
    const TickResult result = core.tick(device_at(tick, {0, 0, -2e-3}));
    CHECK(result.force.norm() <= 1.5 + 1e-12);
    CHECK(std::abs(result.force.z() - last) <= 0.1 + 1e-12);
    last = result.force.z();
  }
  CHECK(last == Approx(1.5)); // 2 * 500 N/m * 2 mm = 2 N, cut off
  DeviceState gone = device_at(100, {0, 0, -2e-3});
  gone.connected = false;
  for (std::uint64_t tick = 100; tick < 116; ++tick) {
    gone.tick = tick;
    last = core.tick(gone).force.z();
  }
  CHECK(last == 0);
}

namespace {

/// A session on a spring at the origin, or on a snapshot of the test's own.
struct Held {
  topology::ToolShape shape = punch;
  HapticTick core;
  ContactSnapshot contact;
  std::uint64_t tick = 0;
  TickResult last;

  explicit Held(const HapticSettings& settings = {}) : core(settings, shape, nullptr) {
    spring(100, Vector3::Zero(), contact);
    core.arrive(contact);
  }
  Vector3 move(const Vector3& to, bool connected = true) {
    DeviceState device = device_at(tick++, to);
    device.connected = connected;
    last = core.tick(device);
    return last.force;
  }
  /// At 30 mm/s. How far the force has been from that of the spring at most, N.
  double lead(double from, double to) {
    double worst = 0;
    const int count = static_cast<int>(std::ceil(std::abs(to - from) / 3e-5));
    for (int i = 0; i <= count; ++i) {
      const double z = from + (to - from) * i / count;
      worst = std::max(worst, std::abs(move({0, 0, z}).z() - 100 * std::max(0.0, -z)));
    }
    return worst;
  }
};

/// By a held force of 0.5 N, wherever it is.
struct PulledAlong : Held {
  PulledAlong() : Held(holding()) {
    clear(contact);
    contact.force = {0, 0, 0.5};
    core.arrive(contact);
  }
  static HapticSettings holding() {
    HapticSettings settings;
    settings.model = ForceModelKind::hold;
    return settings;
  }
};

} // namespace

TEST_CASE("A pose that jumps is no motion: it does no work and leaves no drag") {
  Held held;
  held.lead(1e-3, -3e-3);
  CHECK(held.last.force.z() == Approx(0.3));
  const double energy = held.last.energy;
  CHECK(energy > 0);
  SECTION("into free air, for good") {
    double last = 0.304;           // it would have gone on rising for a tick
    for (int i = 0; i < 25; ++i) { // handed over
      const double force = held.move({0, 0, 0.1}).z();
      CHECK(force >= std::max(0.0, 0.3 - 0.0151 * (i + 1)));
      CHECK(force <= last + 1e-12);
      last = force;
    }
    CHECK(held.last.energy == energy);
    CHECK(last == 0);
    for (int i = 0; i < 1000; ++i)
      CHECK(held.move({0.008 * std::sin(0.006 * i), 0, 0.1}).norm() < 1e-12);
  }
  SECTION("for a tick, into the air or in deep") {
    const double by = GENERATE(-0.03, -0.002, 0.002, 0.0035, 0.01, 0.03);
    const double wrong = held.move({0, 0, -3e-3 + by}).z();
    CHECK(std::abs(wrong - 0.3) < 0.2 + 0.05 * 100 * std::abs(by));
    for (int i = 0; i < 25; ++i)
      held.move({0, 0, -3e-3});
    CHECK(held.last.energy == energy);
    CHECK(held.last.force.z() == Approx(0.3));
    CHECK(held.lead(-3e-3, 1e-3) < 0.02); // that of sampling alone
  }
  SECTION("through the body and back") {
    for (int i = 0; i < 100; ++i)
      held.move({0, 0, -0.1});
    for (int i = 0; i < 25; ++i)
      held.move({0, 0, 0.01});
    CHECK(held.last.energy == energy);
    for (int i = 0; i < 1000; ++i)
      CHECK(held.move({0.008 * std::sin(0.006 * i), 0, 0.01}).norm() < 1e-12);
  }
}

TEST_CASE("What a hand can do is a motion") {
  Held held;
  held.lead(1e-3, -3e-3);
  const double energy = held.last.energy;
  const double step = 0.99e-3 * fastest_hand;
  held.move({0, 0, -3e-3 + step});
  CHECK(held.last.energy == Approx(energy - 0.3 * step));
}

TEST_CASE("Who takes the tool up owes nothing for what was before") {
  PulledAlong held;
  for (int i = 0; i < 200; ++i) // the force pulls the tool along: the hand gets energy
    held.move({0, 0, 5e-5 * i});
  CHECK(held.last.energy < -1e-3);
  CHECK(held.last.force.z() < 0.4);
  ContactSnapshot nothing;
  held.core.arrive(nothing);
  const Vector3 waiting(0, 0, 0.01);
  for (int i = 0; i < 40; ++i)
    held.move(waiting, false);
  CHECK(held.last.force.norm() == 0);
  for (int i = 0; i < 300; ++i)
    CHECK(held.move(waiting + Vector3(3e-5 * i, 0, 0)).norm() < 1e-12);
}

TEST_CASE("A tool that is taken up within the tissue gets its force by and by, and what it finds is not owed") {
  Held held;
  const bool before = GENERATE(true, false); // whether the tissue there has been solved
  const Vector3 deep(0, 0, -3e-3);
  ContactSnapshot elsewhere;
  if (!before)
    held.core.arrive(elsewhere);
  for (int i = 0; i < 10; ++i)
    CHECK(held.move(deep, false).norm() == 0);
  double last = 0;
  for (int i = 0; i < 60; ++i) {
    if (!before && i == 12) {
      held.contact.pose_tick = 11;
      held.core.arrive(held.contact);
    }
    const double force = held.move(deep).z();
    CHECK(force - last < 0.0151);
    CHECK(force >= last - 1e-12);
    last = force;
  }
  CHECK(last == Approx(0.3));
  CHECK(held.lead(-3e-3, 1e-3) < 0.02); // that of sampling alone
}

TEST_CASE("A tool that stands still is not damped") {
  PulledAlong held;
  for (int i = 0; i <= 200; ++i)
    held.move({0, 0, 3e-4 * i});
  CHECK(held.last.force.z() < 0.1);
  for (int i = 0; i < 20; ++i) {
    held.move({0, 0, 0.06});
    if (i >= 5) // slew
      CHECK(held.last.force.z() == Approx(0.5));
  }
}

TEST_CASE("Between two steps of the sensor a slow tool is damped on") {
  PulledAlong held;
  const double step = DeviceLimits{}.resolution;
  double largest = 0;
  double last = 0.5;
  double damping = 0;
  for (int i = 0; i < 1000; ++i) {
    const double force = held.move({0, 0, step * std::round(6.1e-6 * i / step)}).z(); // a step in nine ticks
    if (i >= 500) {
      largest = std::max(largest, std::abs(force - last));
      damping = std::max(damping, 0.5 - force);
    }
    last = force;
  }
  CHECK(damping > 0.02);
  CHECK(largest < 0.4 * damping);
}

TEST_CASE("The observer counts the work of a force that is constant between ticks") {
  PassivityControl control({}, 1000, false);
  Vector3 position(0, 0, 0);
  double work = 0;
  Vector3 sent = Vector3::Zero();
  for (int i = 0; i < 50; ++i) {
    const Vector3 next(1e-4 * i, 2e-5 * i * i, 0);
    if (i > 0)
      work -= sent.dot(next - position);
    position = next;
    const Vector3 force(std::sin(0.1 * i), -0.3, 0.01 * i);
    CHECK(control.control(position, force, std::nullopt) == force);
    control.sent(force);
    sent = force;
  }
  CHECK(control.energy() == Approx(work).epsilon(1e-12));
}

TEST_CASE("A light hand on a stiff spring swings up without the controller and comes to rest with it") {
  const auto run = [](bool passivity) {
    HapticSettings settings;
    settings.passivity = passivity;
    settings.limits.force = 20;
    settings.limits.slew = 1e5;
    settings.limits.resolution = 0;
    settings.limits.delay = 1;
    const topology::ToolShape shape = punch;
    HapticTick core(settings, shape, nullptr);
    ContactSnapshot wall;
    spring(1200, Vector3::Zero(), wall);
    HandSettings light;
    light.mass = 0.08;
    light.stiffness = 60;
    light.damping = 0.2;
    light.delay = 1;
    std::vector<PathPose> path{{0, {0, 0, 1e-3}, Eigen::Quaterniond::Identity()},
                               {0.1, {0, 0, -0.02}, Eigen::Quaterniond::Identity()}};
    SimulatedHand hand(path, light, 1000);
    core.arrive(wall);
    double late = 0; // m/s, fastest in the last half second
    for (std::uint64_t tick = 0; tick < 3000; ++tick) {
      hand.apply(core.tick(hand.read(tick)).force);
      if (tick >= 2500)
        late = std::max(late, hand.velocity().norm());
    }
    return std::pair{late, core.passivity().lowest_energy()};
  };
  const auto [loose, loose_energy] = run(false);
  const auto [kept, kept_energy] = run(true);
  CHECK(loose > 0.2);
  CHECK(loose_energy < -1e-3);
  CHECK(kept < 0.01);
  CHECK(kept_energy > -1e-4);
}

TEST_CASE("The loop in virtual time gives the same bits twice") {
  const auto run = [] {
    HapticSimulation simulation(small("galerkin"));
    SimulatedHand hand(simulation.path(), {}, 1000);
    return run_virtual(HapticSettings{}, simulation, hand, regular_solves(600, 10, 7), 600);
  };
  const LoopRecords a = run();
  const LoopRecords b = run();
  REQUIRE(a.ticks.size() == 600);
  REQUIRE(a.solves.size() == 60);
  double peak = 0;
  for (std::size_t i = 0; i < a.ticks.size(); ++i) {
    CHECK(a.ticks[i].force == b.ticks[i].force);
    CHECK(a.ticks[i].device.position == b.ticks[i].device.position);
    CHECK(a.ticks[i].arrived == (i >= 7 && (i - 7) % 10 == 0));
    peak = std::max(peak, a.ticks[i].force.norm());
  }
  CHECK(peak > 0.01);
  HapticSimulation simulation(small("galerkin"));
  ScriptedPath device(simulation.path(), 1000);
  CHECK_THROWS_AS(run_virtual(HapticSettings{}, simulation, device, {{1, 5, 4, 0}}, 10), InputError);
  CHECK_THROWS_AS(run_virtual(HapticSettings{}, simulation, device, {{1, 5, 6, 0}, {2, 5, 7, 0}}, 10), InputError);
}

TEST_CASE("Rebuilds that miss their budget coarsen the next ones, quick ones refine them again") {
  DegradationRule rule(0.01);
  rule.rebuilt(0.009);
  CHECK(rule.level() == 0);
  rule.rebuilt(0.011);
  rule.rebuilt(0.02);
  CHECK(rule.level() == 2);
  for (int i = 0; i < 7; ++i)
    rule.rebuilt(0.001);
  CHECK(rule.level() == 2);
  rule.rebuilt(0.001);
  CHECK(rule.level() == 1);
  for (int i = 0; i < 20; ++i)
    rule.rebuilt(1);
  CHECK(rule.level() == most_degradation);
}

TEST_CASE("A device has the body wherever it touches, also where the scenario's own path never does") {
  const auto with_path = [](const Vector3& from, const Vector3& to) {
    const std::string text = small_scenario;
    const auto approach = text.find("[tool.approach]"), output = text.find("[output]");
    return text.substr(0, approach) +
           fmt::format(
               "[[tool.path]]\ntime = 0\nposition = [{}, {}, {}]\n[[tool.path]]\ntime = 1\nposition = [{}, {}, {}]\n",
               from.x(), from.y(), from.z(), to.x(), to.y(), to.z()) +
           text.substr(output);
  };
  const std::string above = with_path({0, 0, 0.05}, {0.02, 0, 0.05}); // 20 mm over the block
  const auto force_at = [](HapticSimulation& simulation, const Vector3& place) {
    ContactSnapshot snapshot;
    simulation.prepare(device_at(0, place + Vector3(0, 0, 0.01)));
    for (std::uint64_t tick = 0; tick <= 10; ++tick) // down to it, as a hand comes
      simulation.solve(device_at(tick, place + Vector3(0, 0, 0.001 * static_cast<double>(10 - tick))), 0, snapshot);
    return snapshot.force;
  };
  for (const std::string method : {"galerkin", "collocation"})
    for (const Vector3& place : {Vector3(0, 0, 0.027), Vector3(-0.012, 0.008, 0.027)}) {
      const std::string how = "[method]\nname = \"" + method + "\"\n";
      HapticSimulation aside(scenario_of(above + how));
      HapticSimulation there(scenario_of(with_path(place + Vector3(0, 0, 0.01), place) + how));
      CHECK(aside.session().touches());
      const Vector3 force = force_at(aside, place), expected = force_at(there, place);
      INFO(method << " at " << place.transpose() << ": " << force.transpose() << " N, expected "
                  << expected.transpose());
      CHECK(expected.z() > 0.05);
      CHECK((force - expected).norm() < 0.05 * expected.norm());
    }
  // A run keeps to its path, and is as cheap as before.
  CHECK_FALSE(Session(scenario_of(above)).touches());
}
