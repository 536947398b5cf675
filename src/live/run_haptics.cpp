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

namespace {

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
                     Device& device, const InterruptWatch& watch, HapticRun& run, Progress& progress) {
  const auto stop = [&watch] { return watch.interrupted(); };
  if (command.in_virtual_time) {
    VirtualOptions options;
    options.stop = stop;
    run.recorder->listen(options);
    const std::uint64_t ticks = ticks_of(settings, command.duration);
    LoopRecords records = run_solving(settings, simulation, device, ticks, options);
    run.report.stopped = records.ticks.size() < ticks;
    return records;
  }
  progress.say(
      fmt::format("{:g} s at {:g} ticks/s, model {}", command.duration, settings.rate, to_string(settings.model)));
  const auto* bridge = dynamic_cast<const BridgeDevice*>(&device);
  const auto* haply = dynamic_cast<const HaplyDevice*>(&device);
  if (bridge != nullptr)
    progress.say(fmt::format("bridge at {} port {}", settings.bridge.address, bridge->port()));
  if (haply != nullptr)
    progress.say(fmt::format("Inverse3 {} at {}", haply->device_id(), settings.haply.address));
  RealtimeOptions options;
  PaceKind told = PaceKind::unknown;
  HaplyLink linked = HaplyLink::streams;
  options.stop = [&] { // asked now and then by the viewer's thread, which may say what it sees
    if (haply != nullptr)
      if (const HaplyLink link = haply->link(); link != linked) {
        linked = link;
        progress.say(link_text(link, settings.haply));
      }
    const PaceReading pace = bridge != nullptr ? bridge->pace() : haply != nullptr ? haply->pace() : PaceReading{};
    if (pace.kind != told) {
      told = pace.kind;
      if (bridge != nullptr || told != PaceKind::unknown) // of an Inverse3 its link tells more
        progress.say(pace_text(pace, bridge != nullptr ? "bridge: the client" : "haply: the service"));
    }
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
  if (command.in_virtual_time && (settings.device == HeldDevice::bridge || settings.device == HeldDevice::haply))
    throw InputError(fmt::format("haptics.device = \"{}\" cannot follow virtual time; allowed: without --virtual",
                                 device_name(settings.device)));
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
      const std::unique_ptr<Device> device = make_device(settings, manoeuvre.path);
      if (!claim)
        claim = claim_results_folder(command.out);
      LoopRecords records;
      if (simulated) {
        VirtualOptions options;
        options.stop = [&watch] { return watch.interrupted(); };
        records = run_solving(settings, simulation, *device, ticks_of(settings, manoeuvre.seconds), options);
      } else {
        progress.say(fmt::format("{}, {:g} s: {}", manoeuvre.name, command.duration, manoeuvre.asks));
        HapticRun run; // without a recorder
        records = run_loop(command, settings, simulation, *device, watch, run, progress);
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
  require_hand(scenario);
  const HapticSettings& settings = scenario.haptics;
  require_clock(command, settings);
  HapticRun run;
  std::unique_ptr<HapticSimulation> made;
  std::unique_ptr<Device> device;
  LoopRecords records;
  try {
    interruption_point();
    made = std::make_unique<HapticSimulation>(scenario);
    device = make_device(settings, *made);
    run.claim = claim_results_folder(command.out);
    run.recorder = std::make_unique<Recorder>(command.out, *made);
    records = run_loop(command, settings, *made, *device, watch, run, progress);
    run.recorder->finish(run.report.lost);
  } catch (const Interrupted&) {
    return say_nothing_was_run(command, settings, watch, run, progress);
  }
  const RealtimeReport& report = run.report;
  const HapticSimulation& simulation = *made;
  if (records.ticks.empty() && report.stopped)
    return say_nothing_was_run(command, settings, watch, run, progress);
  const auto* bridge = dynamic_cast<const BridgeDevice*>(device.get());
  HapticFindings findings = findings_of(settings, records, report);
  findings.unfollowed = simulation.session().pending().lags;
  if (bridge != nullptr)
    findings.bridge = bridge->counters();
  if (const auto* haply = dynamic_cast<const HaplyDevice*>(device.get()))
    findings.haply = haply->counters();
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
