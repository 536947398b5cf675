#include "src/live/replay.hpp"

#include "src/base/build_identity.hpp"
#include "topology/base/errors.hpp"
#include "topology/wound/wound.hpp"

#include <algorithm>
#include <bit>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

bool same_bits(const Vector3& a, const Vector3& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (std::bit_cast<std::uint64_t>(a[axis]) != std::bit_cast<std::uint64_t>(b[axis]))
      return false;
  return true;
}

bool same_solve(const SolveRecord& a, const SolveRecord& b, bool torques) {
  return a.failed == b.failed && a.resprinkled == b.resprinkled && a.cut_triangles == b.cut_triangles &&
         a.nodes == b.nodes && a.topology == b.topology && same_bits(a.force, b.force) &&
         (!torques || same_bits(a.torque, b.torque));
}

bool same_second(const TickRecord& now, const RecordedHand* then) {
  if (!now.second || then == nullptr)
    return now.second.has_value() == (then != nullptr);
  return same_bits(now.second->force, then->force) && same_bits(now.second->torque, then->torque);
}

} // namespace

std::string text_of(const ReplayReport& r) {
  std::string text = fmt::format("replay of {} ticks and {} solves: ", r.ticks, r.solves);
  if (r.same())
    text += r.two_hands ? "forces and torques of both hands and topology are the same, bit by bit"
            : r.torques ? "forces, torques and topology are the same, bit by bit"
                        : "forces and topology are the same, bit by bit; this recording has no torques";
  if (r.differing_tick)
    text += fmt::format("force or torque first differ at tick {}, in {} ticks altogether, by up to {:.3g} N and {:.3g} "
                        "N m",
                        *r.differing_tick, r.differing_ticks, r.largest, r.largest_torque);
  if (r.differing_solve)
    text += fmt::format("{}solve {} is the first that differs", r.differing_tick ? "; " : "", *r.differing_solve);
  if (!r.same_build)
    text += "\n  recorded by another build of this program";
  if (!r.same_processor)
    text += "\n  recorded on another processor";
  return text;
}

Scenario recorded_scenario(const Recording& recording) {
  return read_scenario_text(recording.header.scenario, recording.header.scenario_text);
}

ReplayReport replay(const Recording& recording, HapticSimulation& simulation, LoopRecords& records,
                    const std::function<bool()>& stop) {
  const Session& session = simulation.session();
  if (recording.ticks.empty())
    throw InputError("a recording without ticks cannot be replayed; allowed: one tick or more");
  if (const auto organ = topology::surface_hash(session.organ().domain->surface()); organ != recording.header.organ)
    throw InputError(fmt::format("the organ of {} is not the recorded one: its surface has the hash {:016x}, recorded "
                                 "is {:016x}",
                                 recording.header.scenario.string(), organ, recording.header.organ));
  if (session.scenario().haptics.rate != recording.header.rate ||
      session.scenario().nodes.random_seed != recording.header.seed)
    throw InputError("rate or seed of the recording are not those of its scenario; this recording cannot be replayed");
  std::vector<SolveEvent> events;
  for (const SolveRecord& solve : recording.solves)
    if (solve.event.pose_tick < recording.ticks.size())
      events.push_back(solve.event);
  RecordedMotion device(recording, recording.header.rate);
  RecordedMotion other(recording, recording.header.rate, WhichHand::second);
  VirtualOptions options;
  if (recording.two_hands)
    options.second = &other;
  options.stop = stop;
  records = run_virtual(session.scenario().haptics, simulation, device, events, recording.ticks.size(), options);
  ReplayReport report;
  report.ticks = records.ticks.size();
  report.torques = recording.version > 1;
  report.two_hands = recording.two_hands;
  report.solves = std::min(records.solves.size(), events.size());
  report.same_build = recording.header.build == build_identity();
  report.same_processor = recording.header.processor == processor_name();
  for (std::size_t i = 0; i < report.ticks; ++i) {
    const TickRecord& now = records.ticks[i];
    const RecordedTick& then = recording.ticks[i];
    const bool turned = report.torques && !same_bits(now.torque, then.torque);
    const RecordedHand* const second = recording.second_at(i);
    const bool differs = !same_second(now, second);
    if (same_bits(now.force, then.force) && now.sequence == then.sequence && !turned && !differs)
      continue;
    report.differing_tick = report.differing_tick.value_or(i);
    ++report.differing_ticks;
    report.largest = std::max(report.largest, (now.force - then.force).norm());
    if (report.torques)
      report.largest_torque = std::max(report.largest_torque, (now.torque - then.torque).norm());
    if (differs && now.second && second != nullptr) {
      report.largest = std::max(report.largest, (now.second->force - second->force).norm());
      report.largest_torque = std::max(report.largest_torque, (now.second->torque - second->torque).norm());
    }
  }
  for (std::size_t i = 0; i < report.solves && !report.differing_solve; ++i)
    if (!same_solve(records.solves[i], recording.solves[i], report.torques))
      report.differing_solve = recording.solves[i].event.sequence;
  return report;
}

} // namespace spherecut::app
