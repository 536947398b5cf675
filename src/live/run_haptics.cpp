#include "src/live/run_haptics.hpp"

#include "src/base/interrupt.hpp"
#include "src/base/output_file.hpp"
#include "src/base/printable.hpp"
#include "src/base/progress.hpp"
#include "src/live/bench.hpp"
#include "src/live/haptic_report.hpp"
#include "src/live/replay.hpp"
#include "src/model/finite_model.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>

namespace spherecut::app {

namespace {

constexpr const char* recording_name = "haptic.recording";
constexpr std::uint64_t flush_ticks = 100; // between two lots on disk

// Writes the recording of a session as it goes.
class Recorder {
 public:
  Recorder(const std::filesystem::path& folder, const HapticSimulation& simulation)
      : writer_(folder / recording_name,
                recording_header(simulation.session().scenario(), simulation.session().organ().domain->surface())) {}
  template <typename Options>
  void listen(Options& options) {
    options.on_tick = [this](const TickRecord& tick) {
      writer_.add(tick);
      if (tick.device.tick % flush_ticks == flush_ticks - 1)
        writer_.flush();
    };
    options.on_solve = [this](const SolveRecord& solve) { writer_.add(solve); };
  }
  void finish(std::uint64_t lost) { writer_.finish(lost); }

 private:
  RecordingWriter writer_;
};

RunEnd run_replay(const HapticCommand& command, const InterruptWatch& watch, Progress& progress) {
  const Recording recording = read_recording(command.replay);
  progress.say(fmt::format("{}: {} ticks, {} solves, of {}{}", command.replay.string(), recording.ticks.size(),
                           recording.solves.size(), recording.header.scenario.string(),
                           recording.finished ? "" : "; the session was killed"));
  HapticSimulation simulation(recorded_scenario(recording));
  const ResultsClaim claim = claim_results_folder(command.out);
  LoopRecords records;
  const ReplayReport report = replay(recording, simulation, records, [&] { return watch.interrupted(); });
  const WindingUp winding_up(watch.interrupted());
  watch.wind_up();
  write_haptics(command.out, records, findings_of(simulation.session().scenario().haptics, records, {}), {});
  progress.say(text_of(report));
  if (!report.same())
    return RunEnd::differs;
  return report.ticks < recording.ticks.size() ? RunEnd::interrupted : RunEnd::complete;
}

} // namespace

std::unique_ptr<Device> make_device(const HapticSettings& settings, const std::vector<PathPose>& path) {
  switch (settings.device) {
  case HeldDevice::script:
    return std::make_unique<ScriptedPath>(path, settings.rate);
  case HeldDevice::recording:
    return std::make_unique<RecordedMotion>(read_recording(settings.recording), settings.rate);
  case HeldDevice::bridge:
    return std::make_unique<BridgeDevice>(settings.bridge, path.front(), settings.rate);
  case HeldDevice::haply:
    return std::make_unique<HaplyDevice>(settings.haply, path.front(), settings.rate);
  case HeldDevice::hand:
    break;
  }
  return std::make_unique<SimulatedHand>(path, settings.hand, settings.rate);
}

std::unique_ptr<Device> make_device(const HapticSettings& settings, const HapticSimulation& simulation) {
  return make_device(settings, simulation.path());
}

std::unique_ptr<Device> make_second_device(const HapticSettings& settings, const HapticSimulation& simulation) {
  if (settings.device == HeldDevice::recording) {
    const Recording recording = read_recording(settings.recording);
    if (!recording.two_hands)
      return nullptr;
    return std::make_unique<RecordedMotion>(recording, settings.rate, WhichHand::second);
  }
  if (!settings.second)
    return nullptr;
  HapticSettings own = settings;
  own.device = settings.second->device;
  own.bridge = settings.second->bridge;
  own.haply = settings.second->haply;
  return make_device(own, simulation.second_path());
}

namespace {

/// A device of real hardware, and what is said of it while it runs.
class WatchedDevice {
 public:
  /// `hand`: before what is said; empty where there is one hand. `haply`: of that device.
  WatchedDevice(const Device* device, std::string hand, const HaplySettings& haply)
      : bridge_(dynamic_cast<const BridgeDevice*>(device)), haply_(dynamic_cast<const HaplyDevice*>(device)),
        hand_(std::move(hand)), settings_(haply) {}

  void say_where(const std::string& address, Progress& progress) const {
    if (bridge_ != nullptr)
      progress.say(fmt::format("{}bridge at {} port {}", hand_, address, bridge_->port()));
    if (haply_ != nullptr)
      progress.say(fmt::format("{}Inverse3 {} at {}", hand_, haply_->device_id(), settings_.address));
  }

  /// What has changed since the last time.
  void say_changes(Progress& progress) {
    if (haply_ != nullptr)
      if (const HaplyLink link = haply_->link(); link != linked_) {
        linked_ = link;
        progress.say(hand_ + link_text(link, settings_));
      }
    const PaceReading pace = bridge_ != nullptr ? bridge_->pace() : haply_ != nullptr ? haply_->pace() : PaceReading{};
    if (pace.kind == told_)
      return;
    told_ = pace.kind;
    if (bridge_ != nullptr || told_ != PaceKind::unknown) // of an Inverse3 its link tells more
      progress.say(hand_ + pace_text(pace, bridge_ != nullptr ? "bridge: the client" : "haply: the service"));
  }

  void count(std::optional<BridgeCounters>& bridge, std::optional<HaplyCounters>& haply) const {
    if (bridge_ != nullptr)
      bridge = bridge_->counters();
    if (haply_ != nullptr)
      haply = haply_->counters();
  }

 private:
  const BridgeDevice* bridge_;
  const HaplyDevice* haply_;
  std::string hand_;
  HaplySettings settings_;
  PaceKind told_ = PaceKind::unknown;
  HaplyLink linked_ = HaplyLink::streams;
};

/// What both hands hold.
struct HeldDevices {
  std::unique_ptr<Device> first, second; // second null: there is none
};

/// A session and what it left behind.
struct HapticRun {
  std::optional<ResultsClaim> claim;
  std::unique_ptr<Recorder> recorder;
  RealtimeReport report;
};

std::uint64_t ticks_of(const HapticSettings& settings, double seconds) {
  return static_cast<std::uint64_t>(std::max(1.0, std::round(seconds * settings.rate)));
}

// In virtual time, with a solve every budget that takes all of it.
LoopRecords run_solving(const HapticSettings& settings, HapticSimulation& simulation, Device& device,
                        std::uint64_t ticks, const VirtualOptions& options) {
  const std::uint64_t period = ticks_of(settings, settings.budget);
  return run_virtual(settings, simulation, device, regular_solves(ticks, period, period), ticks, options);
}

LoopRecords run_loop(const HapticCommand& command, const HapticSettings& settings, HapticSimulation& simulation,
                     const HeldDevices& devices, const InterruptWatch& watch, HapticRun& run, Progress& progress) {
  Device& device = *devices.first;
  const auto stop = [&watch] { return watch.interrupted(); };
  if (command.in_virtual_time) {
    VirtualOptions options;
    options.stop = stop;
    options.second = devices.second.get();
    run.recorder->listen(options);
    const std::uint64_t ticks = ticks_of(settings, command.duration);
    LoopRecords records = run_solving(settings, simulation, device, ticks, options);
    run.report.stopped = records.ticks.size() < ticks;
    return records;
  }
  progress.say(
      fmt::format("{:g} s at {:g} ticks/s, model {}", command.duration, settings.rate, to_string(settings.model)));
  WatchedDevice first(&device, devices.second != nullptr ? "first hand: " : "", settings.haply);
  WatchedDevice second(devices.second.get(), "second hand: ", settings.second.value_or(SecondDevice{}).haply);
  first.say_where(settings.bridge.address, progress);
  second.say_where(settings.second.value_or(SecondDevice{}).bridge.address, progress);
  RealtimeOptions options;
  options.second = devices.second.get();
  options.stop = [&] { // asked now and then by the viewer's thread, which may say what it sees
    first.say_changes(progress);
    second.say_changes(progress);
    return watch.interrupted();
  };
  if (run.recorder)
    run.recorder->listen(options);
  return run_realtime(settings, simulation, device, command.duration, options, run.report);
}

RunEnd say_nothing_was_run(const HapticCommand& command, const HapticSettings& settings, const InterruptWatch& watch,
                           HapticRun& run, Progress& progress) {
  const WindingUp winding_up;
  watch.wind_up();
  if (!run.claim)
    run.claim = claim_results_folder(command.out);
  run.report.stopped = true;
  write_haptics(command.out, {}, findings_of(settings, {}, run.report), {});
  progress.say(
      fmt::format("interrupted while preparing: nothing was run. {} has files without rows", command.out.string()));
  return RunEnd::interrupted;
}

// Real hardware has the clock's time.
void require_clock(const HapticCommand& command, const HapticSettings& settings) {
  const auto require = [&](HeldDevice device, const char* key) {
    if (command.in_virtual_time && (device == HeldDevice::bridge || device == HeldDevice::haply))
      throw InputError(
          fmt::format("{} = \"{}\" cannot follow virtual time; allowed: without --virtual", key, device_name(device)));
  };
  require(settings.device, "haptics.device");
  if (settings.second)
    require(settings.second->device, "haptics.second.device");
}

// A simulated device does its four manoeuvres in virtual time; a real one as somebody does them, for so long each.
RunEnd run_bench(const HapticCommand& command, const InterruptWatch& watch, Progress& progress) {
  HapticSettings settings;
  if (command.scenario.empty())
    settings.hand.resolution = settings.limits.resolution;
  else
    settings = read_scenario(command.scenario).haptics;
  require_clock(command, settings);
  const bool simulated = settings.device == HeldDevice::hand || settings.device == HeldDevice::script;
  if (settings.device == HeldDevice::recording)
    throw InputError("--bench with haptics.device = \"recording\": allowed: hand, script, bridge, haply");
  std::optional<ResultsClaim> claim;
  std::vector<BenchResult> results;
  try {
    for (const Manoeuvre& manoeuvre : bench_manoeuvres(settings)) {
      interruption_point();
      HapticSimulation simulation(manoeuvre.scenario);
      const HeldDevices devices{make_device(settings, manoeuvre.path), nullptr};
      if (!claim)
        claim = claim_results_folder(command.out);
      LoopRecords records;
      if (simulated) {
        VirtualOptions options;
        options.stop = [&watch] { return watch.interrupted(); };
        records = run_solving(settings, simulation, *devices.first, ticks_of(settings, manoeuvre.seconds), options);
      } else {
        progress.say(fmt::format("{}, {:g} s: {}", manoeuvre.name, command.duration, manoeuvre.asks));
        HapticRun run; // without a recorder
        records = run_loop(command, settings, simulation, devices, watch, run, progress);
      }
      interruption_point();
      results.push_back({manoeuvre.name, bench_figures(bench_series(settings, records), manoeuvre.holds)});
      progress.say(fmt::format("{}: {} ticks", manoeuvre.name, records.ticks.size()));
    }
  } catch (const Interrupted&) { // the manoeuvre at hand is given up
  }
  const WindingUp winding_up(watch.interrupted());
  watch.wind_up();
  if (!claim)
    claim = claim_results_folder(command.out);
  progress.say(fmt::format("device {}, {:g} ticks/s, model {}, controller {}", device_name(settings.device),
                           settings.rate, to_string(settings.model), settings.passivity ? "on" : "off"));
  progress.say(bench_table(results));
  write_bench(command.out, settings, results);
  progress.say(fmt::format("results in {}: haptic_bench.json", command.out.string()));
  return watch.interrupted() ? RunEnd::interrupted : RunEnd::complete;
}

} // namespace

RunEnd run_haptics(const HapticCommand& command, std::FILE* screen) {
  const InterruptWatch watch(
      printable(fmt::format("interrupted; {} has what was recorded until then", command.out.string())),
      status_of_interrupted);
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  if (!command.bench && command.scenario.empty() == command.replay.empty())
    throw InputError("spherecut haptics needs a scenario, or --replay with a recording, or --bench");
  if (!command.replay.empty())
    return run_replay(command, watch, progress);
  if (!(command.duration > 0) || command.duration > 1e5)
    throw InputError(fmt::format("--duration {:g} s: allowed: above 0, at most 1e5", command.duration));
  if (command.bench)
    return run_bench(command, watch, progress);
  const Scenario scenario = read_scenario(command.scenario);
  require_run(scenario);
  const HapticSettings& settings = scenario.haptics;
  require_clock(command, settings);
  HapticRun run;
  std::unique_ptr<HapticSimulation> made;
  HeldDevices devices;
  LoopRecords records;
  try {
    interruption_point();
    made = std::make_unique<HapticSimulation>(scenario);
    devices = {make_device(settings, *made), make_second_device(settings, *made)};
    run.claim = claim_results_folder(command.out);
    run.recorder = std::make_unique<Recorder>(command.out, *made);
    records = run_loop(command, settings, *made, devices, watch, run, progress);
    run.recorder->finish(run.report.lost);
  } catch (const Interrupted&) {
    return say_nothing_was_run(command, settings, watch, run, progress);
  }
  const RealtimeReport& report = run.report;
  const HapticSimulation& simulation = *made;
  if (records.ticks.empty() && report.stopped)
    return say_nothing_was_run(command, settings, watch, run, progress);
  HapticFindings findings = findings_of(settings, records, report);
  findings.unfollowed = simulation.session().pending().lags;
  WatchedDevice(devices.first.get(), "", {}).count(findings.bridge, findings.haply);
  WatchedDevice(devices.second.get(), "", {}).count(findings.second.bridge, findings.second.haply);
  std::vector<SolvedForce> solved;
  bool is_cut_short = false; // the session is complete, what follows it is not
  if (command.solved_stride > 0 && (scenario.tool || simulation.session().blade() != nullptr) && !report.stopped) {
    say("solving off line for the error of the force model (--solved-every 0 leaves that out)");
    try {
      HapticSimulation again(scenario);
      const auto stride = static_cast<std::uint64_t>(command.solved_stride);
      solved = solve_recorded(again, records.ticks, stride, [&] { return watch.interrupted(); });
    } catch (const Interrupted&) {
    }
    is_cut_short = watch.interrupted();
    if (is_cut_short)
      solved.clear();
    else
      findings.error = model_error(records.ticks, solved);
  }
  const WindingUp winding_up(watch.interrupted());
  watch.wind_up();
  write_haptics(command.out, records, findings, solved);
  say(text_of(findings));
  for (const std::string& remark : simulation.session().warnings())
    say("warning: " + remark);
  say(fmt::format("results in {}: haptic_ticks.csv haptic_solves.csv haptic_deadlines.csv haptic.json {}",
                  command.out.string(), recording_name));
  if (report.stopped)
    say("interrupted: what there is up to then is kept");
  else if (is_cut_short)
    say("interrupted: the session is complete, the error of the force model is not known");
  return report.stopped || is_cut_short ? RunEnd::interrupted : RunEnd::complete;
}

} // namespace spherecut::app
