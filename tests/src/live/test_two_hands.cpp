// Two hands in the haptic loop: a grasper or probe in the first, the blade in the second, one solve for both.
#include "src/live/haptic_report.hpp"
#include "src/live/realtime_loop.hpp"
#include "src/live/replay.hpp"
#include "src/live/run_haptics.hpp"
#include "src/live/virtual_loop.hpp"

#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

constexpr std::uint64_t ticks = 2001;      // to the end of the way of lifted_flap()
constexpr std::uint64_t solve_every = 250; // ticks, as its steps

/// On a path, with something in a hand that changes over its ticks.
class Holder : public Device {
 public:
  Holder(std::vector<PathPose> path, std::function<void(DeviceState&)> hold)
      : path_(std::move(path), 1000), hold_(std::move(hold)) {}
  DeviceState read(std::uint64_t tick) noexcept override {
    DeviceState state = path_.read(tick);
    hold_(state);
    return state;
  }
  void apply(const Vector3& force) noexcept override { felt = force; }
  Vector3 felt = Vector3::Zero();

 private:
  ScriptedPath path_;
  std::function<void(DeviceState&)> hold_;
};

void grasp(DeviceState& state) {
  state.mode = static_cast<std::uint16_t>(HandMode::grasper);
  state.buttons = 1;
}

void hold_blade(DeviceState& state) {
  state.mode = static_cast<std::uint16_t>(HandMode::blade);
}

/// The blade from tick 900 to 1600 and from 1700 on; nothing before and in between.
void hold_blade_at_times(DeviceState& state) {
  const bool holds = state.tick >= 900 && (state.tick < 1600 || state.tick >= 1700);
  state.mode = static_cast<std::uint16_t>(holds ? HandMode::blade : HandMode::probe);
}

struct Run {
  LoopRecords records;
  Vector3 first, second; // N, that the devices felt last
};

Run run_hands(const Scenario& scenario, const std::function<void(DeviceState&)>& blade,
              RecordingWriter* writer = nullptr) {
  HapticSimulation simulation(scenario);
  Holder first(simulation.path(), grasp);
  Holder second(simulation.second_path(), blade);
  VirtualOptions options;
  options.second = &second;
  if (writer != nullptr) {
    options.on_tick = [&](const TickRecord& tick) { writer->add(tick); };
    options.on_solve = [&](const SolveRecord& solve) { writer->add(solve); };
  }
  Run run;
  run.records = run_virtual(scenario.haptics, simulation, first, regular_solves(ticks, solve_every, 0), ticks, options);
  run.first = first.felt;
  run.second = second.felt;
  return run;
}

} // namespace

TEST_CASE("Grasper and blade in two hands are solved at once: both wrenches are those of a run on the same ways") {
  const std::string law = GENERATE(as<std::string>(), "", "law = \"neo_hookean\"\n");
  CAPTURE(law);
  const Scenario scenario = scenario_of(lifted_flap(law, 0.002));
  Session session(scenario);
  std::vector<StepResult> steps;
  for (const StepSample& sample : session.steps())
    steps.push_back(session.step(sample));
  const Run run = run_hands(scenario, hold_blade);
  REQUIRE(run.records.solves.size() == steps.size());
  double peak = 0;
  for (const StepResult& step : steps)
    peak = std::max(peak, step.force.norm());
  CHECK(peak > 0.005);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const SolveRecord& solve = run.records.solves[k];
    CAPTURE(k);
    CHECK_FALSE(solve.failed);
    CHECK((solve.force - steps[k].force).norm() < 0.02 * peak);
    CHECK((solve.torque - steps[k].torque).norm() < 0.02 * peak * 0.01);
    CHECK((solve.blade_force - steps[k].cut->blade.force).norm() < 0.03 * 2 * 0.016); // G_c times the width
    CHECK(solve.cut_area == Approx(steps[k].cut->area).epsilon(0.02));
  }
  // Each hand has its own, after the hand-over.
  const TickRecord& last = run.records.ticks.back();
  REQUIRE(last.second);
  const TickRecord& before = run.records.ticks[ticks - 2]; // long after the solve before the last
  CHECK((before.tissue - run.records.solves[steps.size() - 2].force).norm() < 1e-9);
  CHECK(last.second->device.mode == static_cast<std::uint16_t>(HandMode::blade));
  CHECK(run.second.norm() > 0);
  CHECK((run.first - run.second).norm() > 1e-3);
  CHECK(run.records.solves.back().blade_force.norm() > 1e-3);
}

TEST_CASE("What one hand lifts makes the blade in the other hand lighter") {
  const auto work = [](double lift) { // J/m2 of the cut
    const std::vector<SolveRecord> solves = run_hands(scenario_of(lifted_flap("", lift)), hold_blade).records.solves;
    const double area = solves.back().cut_area - solves.front().cut_area;
    CHECK(area > 1.3e-4);
    return solves.back().blade_account.work / area;
  };
  CHECK(work(0.0002) == Approx(2).epsilon(0.05)); // the toughness
  CHECK(work(0.008) < 0.8 * 2);
}

TEST_CASE("A session of two hands is recorded and replays bit by bit, also where the second lays its blade away") {
  const TemporaryFolder folder;
  const std::string text = lifted_flap("", 0.002);
  const Scenario scenario = read_scenario(write_file(folder.path() / "s.toml", text));
  const std::filesystem::path file = folder.path() / "two.recording";
  {
    HapticSimulation simulation(scenario);
    RecordingWriter writer(file, recording_header(scenario, simulation.session().organ().domain->surface()));
    const Run run = run_hands(scenario, hold_blade_at_times, &writer);
    writer.finish();
    CHECK_FALSE(run.records.ticks[899].second);
    CHECK(run.records.ticks[900].second);
    CHECK_FALSE(run.records.ticks[1650].second);
    double felt = 0;
    for (const TickRecord& tick : run.records.ticks)
      felt = std::max(felt, tick.second ? tick.second->force.norm() : 0.0);
    CHECK(felt > 1e-3);
  }
  const Recording recording = read_recording(file);
  CHECK(recording.version == recording_version);
  CHECK(recording.two_hands);
  HapticSimulation again(recorded_scenario(recording));
  LoopRecords records;
  const ReplayReport report = replay(recording, again, records);
  INFO(text_of(report));
  CHECK(report.same());
  CHECK(report.two_hands);
  CHECK(text_of(report).find("both hands") != std::string::npos);
  // Another motion of the second hand is found out.
  Recording other = recording;
  for (RecordedHand& hand : other.seconds)
    if (hand.device.tick >= 1800)
      hand.device.position.z() += 1e-3;
  HapticSimulation third(recorded_scenario(recording));
  CHECK_FALSE(replay(other, third, records).same());
}

TEST_CASE("A blade that is laid away and taken up elsewhere between two solves does not cut on the way there") {
  const Scenario scenario = scenario_of(lifted_flap("", 0.0002));
  const auto area_at = [](const Run& run, std::uint64_t tick) {
    return run.records.solves[tick / solve_every].cut_area;
  };
  const Run whole = run_hands(scenario, hold_blade);
  CHECK(area_at(whole, 1750) > area_at(whole, 1500) + 2e-5);
  const Run laid = run_hands(scenario, [](DeviceState& state) {
    state.mode = static_cast<std::uint16_t>(state.tick > 1510 && state.tick < 1560 ? HandMode::probe : HandMode::blade);
  });
  CHECK(area_at(laid, 1500) == area_at(whole, 1500));
  CHECK(area_at(laid, 1750) == area_at(laid, 1500));
  const Run silent = run_hands(scenario, [](DeviceState& state) {
    hold_blade(state);
    state.connected = state.tick <= 1510 || state.tick >= 1560;
  });
  CHECK(area_at(silent, 1750) == area_at(silent, 1500));
  const Run jumped = run_hands(scenario, [](DeviceState& state) {
    hold_blade(state);
    if (state.tick >= 1560)
      state.position.x() += 0.004; // within a tick
  });
  CHECK(area_at(jumped, 1750) == area_at(jumped, 1500));
}

TEST_CASE("A blade that no hand holds goes nowhere, whatever the scenario's path") {
  const Scenario scenario = scenario_of(lifted_flap("", 0.0002));
  HapticSimulation simulation(scenario);
  ScriptedPath first(simulation.path(), 1000); // in the usual mode
  Holder second(simulation.second_path(),
                [](DeviceState& state) { state.mode = static_cast<std::uint16_t>(HandMode::probe); });
  VirtualOptions options;
  options.second = &second;
  const LoopRecords records =
      run_virtual(scenario.haptics, simulation, first, regular_solves(ticks, solve_every, 0), ticks, options);
  CHECK(records.solves.back().cut_area == records.solves.front().cut_area);
  CHECK_FALSE(records.solves.back().failed);
}

TEST_CASE("Cuts that are made in the background arrive while the tool in the other hand moves") {
  const std::string text =
      "[organ]\nshape = \"block\"\nsize = [0.06, 0.06, 0.03]\nedge = 0.006\n[material]\nyoung_modulus = "
      "1e4\npoisson_ratio = 0.3\ntoughness = 2\n[[fixed]]\nregion = \"half_space\"\npoint = [-0.029, 0, 0]\nnormal = "
      "[1, 0, 0]\n[[fixed]]\nregion = \"half_space\"\npoint = [0.029, 0, 0]\nnormal = [-1, 0, "
      "0]\n[nodes]\nfine_spacing = 0.007\ncoarse_spacing = 0.014\nfine_radius = 0.008\n[tool]\nshape = "
      "\"sphere_tip\"\nradius = 0.01\nstep = 0.1\n[[tool.path]]\ntime = 0\nposition = [-0.014, 0.001, "
      "0.034]\n[[tool.path]]\ntime = 1\nposition = [-0.014, 0.001, 0.028]\n[blade]\nedge = [[0, 0, -0.01], [0, 0, "
      "0.03]]\n[[blade.path]]\ntime = 0\nposition = [0.013, 0.034, 0.022]\n[[blade.path]]\ntime = 2\nposition = "
      "[0.013, 0.004, 0.022]\n";
  const Scenario scenario = scenario_of(text);
  HapticSimulation simulation(scenario);
  Holder first(simulation.path(), [](DeviceState& state) {
    state.mode = static_cast<std::uint16_t>(HandMode::probe);
    state.position.z() += 1e-4 * std::sin(0.05 * static_cast<double>(state.tick)); // a hand is never still
  });
  Holder second(simulation.second_path(), hold_blade);
  VirtualOptions options;
  options.second = &second;
  std::vector<SolveEvent> events = regular_solves(ticks, 40, 0);
  for (std::size_t i = 0; i < events.size(); ++i) {
    events[i].in_background = true;
    events[i].swaps = i % 2 == 1;
  }
  const LoopRecords records = run_virtual(scenario.haptics, simulation, first, events, ticks, options);
  CHECK(records.solves.back().cut_area > 0.5 * 0.018 * 0.026);
}

TEST_CASE("The second hand holds the blade unless the first has it, or it says that it holds nothing") {
  const std::vector<PathPose> rest{{0, Vector3::Zero(), Eigen::Quaterniond::Identity()}};
  const auto mode = [](HandMode held) {
    return [held](DeviceState& state) { state.mode = static_cast<std::uint16_t>(held); };
  };
  const auto has_blade = [&](HandMode first, HandMode second) {
    Holder one(rest, mode(first)), two(rest, mode(second));
    const Hands hands = read_hands(one, &two, 3);
    CHECK(hands.first.mode == static_cast<std::uint16_t>(first));
    return hands.second.has_value();
  };
  CHECK(has_blade(HandMode::usual, HandMode::usual));
  CHECK(has_blade(HandMode::grasper, HandMode::blade));
  CHECK_FALSE(has_blade(HandMode::blade, HandMode::usual));
  CHECK_FALSE(has_blade(HandMode::probe, HandMode::probe));
  Holder one(rest, mode(HandMode::usual));
  CHECK_FALSE(read_hands(one, nullptr, 0).second);
}

TEST_CASE("A second hand without a blade, or on the first one's socket, is refused with the line") {
  const std::string flap = lifted_flap("", 0.002);
  CHECK(complaint(flap + "[haptics.second]\n").empty());
  CHECK(complaint(small_scenario + "[haptics.second]\n").find("no [blade]") != std::string::npos);
  const std::string bridges = "[haptics]\ndevice = \"bridge\"\n[haptics.second]\ndevice = \"bridge\"\n";
  CHECK(complaint(flap + bridges).empty());
  CHECK(complaint(flap + bridges + "[haptics.second.bridge]\nport = 27510\n").find("that of the first hand") !=
        std::string::npos);
  CHECK(complaint(flap + "[haptics]\ndevice = \"haply\"\n[haptics.second]\ndevice = \"haply\"\n").find("device_id") !=
        std::string::npos);
  CHECK(complaint(flap + "[haptics.second]\ndevice = \"recording\"\n").find("haptics.second.device") !=
        std::string::npos);
}

TEST_CASE("spherecut haptics runs two hands, tells of both, and replays them") {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder.path() / "out";
  write_file(folder.path() / "s.toml", lifted_flap("", 0.002) + "[haptics.second]\ndevice = \"script\"\n");
  const auto ran = run_spherecut({"haptics", (folder.path() / "s.toml").string(), "--virtual", "--duration", "2",
                                  "--solved-every", "0", "--out", out.string()});
  INFO(ran.out);
  REQUIRE(ran.status == 0);
  CHECK(ran.out.find("second hand, with the blade: 2000 ticks") != std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(read_file(out / "haptic.json"));
  CHECK(json["second_hand"]["ticks"] == 2000);
  CHECK(json["second_hand"]["peak_force_N"].get<double>() > 1e-3);
  const std::string table = read_file(out / "haptic_second.csv");
  CHECK(std::count(table.begin(), table.end(), '\n') == 2001);
  const auto replayed = run_spherecut(
      {"haptics", "--replay", (out / "haptic.recording").string(), "--out", (folder.path() / "again").string()});
  INFO(replayed.out);
  CHECK(replayed.status == 0);
  CHECK(replayed.out.find("both hands") != std::string::npos);
}
