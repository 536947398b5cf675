#include "src/haptics/run_haptics.hpp"

#include "src/haptics/haptic_report.hpp"
#include "src/haptics/replay.hpp"
#include "src/interrupt.hpp"
#include "src/law_reader.hpp"
#include "src/output_file.hpp"
#include "src/printable.hpp"
#include "src/progress.hpp"
#include "topology/errors.hpp"
#include "topology/interruption.hpp"

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

std::unique_ptr<Device> make_device(const HapticSettings& settings, const HapticSimulation& simulation) {
  switch (settings.device) {
  case HeldDevice::script:
    return std::make_unique<ScriptedPath>(simulation.path(), settings.rate);
  case HeldDevice::recording:
    return std::make_unique<RecordedMotion>(read_recording(settings.recording), settings.rate);
  case HeldDevice::bridge:
    return std::make_unique<BridgeDevice>(settings.bridge, simulation.path().front(), settings.rate);
  case HeldDevice::hand:
    break;
  }
  return std::make_unique<SimulatedHand>(simulation.path(), settings.hand, settings.rate);
}

namespace {

/// A session and what it left behind.
struct HapticRun {
  std::optional<ResultsClaim> claim;
  std::unique_ptr<Recorder> recorder;
  RealtimeReport report;
};

LoopRecords run_loop(const HapticCommand& command, const HapticSettings& settings, HapticSimulation& simulation,
                     Device& device, const InterruptWatch& watch, HapticRun& run, Progress& progress) {
  const auto stop = [&watch] { return watch.interrupted(); };
  if (command.in_virtual_time) {
    const auto ticks = static_cast<std::uint64_t>(std::max(1.0, std::round(command.duration * settings.rate)));
    const auto period = static_cast<std::uint64_t>(std::max(1.0, std::round(settings.budget * settings.rate)));
    VirtualOptions options;
    options.stop = stop;
    run.recorder->listen(options);
    LoopRecords records =
        run_virtual(settings, simulation, device, regular_solves(ticks, period, period), ticks, options);
    run.report.stopped = records.ticks.size() < ticks;
    return records;
  }
  progress.say(
      fmt::format("{:g} s at {:g} ticks/s, model {}", command.duration, settings.rate, to_string(settings.model)));
  if (const auto* bridge = dynamic_cast<const BridgeDevice*>(&device))
    progress.say(fmt::format("bridge at {} port {}", settings.bridge.address, bridge->port()));
  RealtimeOptions options;
  options.stop = stop;
  PaceKind told = PaceKind::unknown;
  if (const auto* bridge = dynamic_cast<const BridgeDevice*>(&device))
    options.stop = [&, bridge] { // asked now and then by the viewer's thread, which may say what it sees
      if (const BridgePace pace = bridge->pace(); pace.kind != told) {
        told = pace.kind;
        progress.say(pace_text(pace));
      }
      return watch.interrupted();
    };
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

} // namespace

RunEnd run_haptics(const HapticCommand& command, std::FILE* screen) {
  const InterruptWatch watch(
      printable(fmt::format("interrupted; {} has what was recorded until then", command.out.string())),
      status_of_interrupted);
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  if (command.scenario.empty() == command.replay.empty())
    throw InputError("spherecut haptics needs a scenario, or --replay with a recording");
  if (!command.replay.empty())
    return run_replay(command, watch, progress);
  if (!(command.duration > 0) || command.duration > 1e5)
    throw InputError(fmt::format("--duration {:g} s: allowed: above 0, at most 1e5", command.duration));
  const Scenario scenario = read_scenario(command.scenario);
  require_linear(scenario.file, scenario.law);
  const HapticSettings& settings = scenario.haptics;
  if (command.in_virtual_time && settings.device == HeldDevice::bridge)
    throw InputError("haptics.device = \"bridge\" cannot follow virtual time; allowed: without --virtual");
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
  findings.unfollowed = simulation.session().lags_behind_blade();
  if (bridge != nullptr)
    findings.bridge = bridge->counters();
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
