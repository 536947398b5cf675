#include "src/haptics/run_haptics.hpp"

#include "src/haptics/haptic_report.hpp"
#include "src/interrupt.hpp"
#include "src/output_file.hpp"
#include "src/progress.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {

std::unique_ptr<Device> make_device(const HapticSettings& settings, const HapticSimulation& simulation) {
  if (settings.device == HeldDevice::script)
    return std::make_unique<ScriptedPath>(simulation.path(), settings.rate);
  return std::make_unique<SimulatedHand>(simulation.path(), settings.hand, settings.rate);
}

RunEnd run_haptics(const HapticCommand& command, std::FILE* screen) {
  const InterruptWatch watch;
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  if (!(command.duration > 0) || command.duration > 1e5)
    throw InputError(fmt::format("--duration {:g} s: allowed: above 0, at most 1e5", command.duration));
  const Scenario scenario = read_scenario(command.scenario);
  const HapticSettings& settings = scenario.haptics;
  HapticSimulation simulation(scenario);
  claim_results_folder(command.out);
  const std::unique_ptr<Device> device = make_device(settings, simulation);
  RealtimeReport report;
  LoopRecords records;
  if (command.in_virtual_time) {
    const auto ticks = static_cast<std::uint64_t>(std::max(1.0, std::round(command.duration * settings.rate)));
    const auto period = static_cast<std::uint64_t>(std::max(1.0, std::round(settings.budget * settings.rate)));
    records = run_virtual(settings, simulation, *device, regular_solves(ticks, period, period), ticks);
  } else {
    say(fmt::format("{:g} s at {:g} ticks/s, model {}", command.duration, settings.rate, to_string(settings.model)));
    RealtimeOptions options;
    options.stop = [&] { return watch.interrupted(); };
    records = run_realtime(settings, simulation, *device, command.duration, options, report);
  }
  HapticFindings findings = findings_of(settings, records, report);
  std::vector<SolvedForce> solved;
  if (command.solved_stride > 0 && scenario.tool) {
    say("solving off line for the error of the force model");
    HapticSimulation again(scenario);
    solved = solve_recorded(again, records.ticks, static_cast<std::uint64_t>(command.solved_stride));
    findings.error = model_error(records.ticks, solved);
  }
  write_haptics(command.out, records, findings, solved);
  say(text_of(findings));
  for (const std::string& remark : simulation.session().warnings())
    say("warning: " + remark);
  say(fmt::format("results in {}: haptic_ticks.csv haptic_solves.csv haptic_deadlines.csv haptic.json",
                  command.out.string()));
  return report.stopped ? RunEnd::interrupted : RunEnd::complete;
}

} // namespace spherecut::app
