// The threads about the tick: the haptic thread at its rate, the simulation thread as fast as it can, and the caller's
// own as the viewer. Nothing but triple buffers lies between them.
#pragma once

#include "src/haptics/loop_records.hpp"
#include "src/live/viewer_feed.hpp"

#include <functional>

namespace spherecut::app {

/// What a session in real time did besides its records.
struct RealtimeReport {
  bool fifo = false;             // SCHED_FIFO was granted
  double seconds = 0;            // wall clock
  std::uint64_t overruns = 0;    // ticks that ended after the next one was due
  double prepare_seconds = 0;    // before the first tick
  double solve_seconds = 0;      // wall clock in solves
  double viewer_seconds = 0;     // in frames
  double haptic_cpu_seconds = 0; // processor time of the haptic thread in ticks
  std::uint64_t frames = 0;
  std::uint64_t ticks = 0;
  std::uint64_t lost = 0; // ticks and solves that went unrecorded: the caller's thread was a whole ring behind
  bool stopped = false;   // before its time
};

struct RealtimeOptions {
  Device* second = nullptr; // of a second hand, which has the blade; null: there is none
  bool fifo = true;         // ask for SCHED_FIFO
  double spin = 1e-4; // s before a tick is due from which the thread spins; only with SCHED_FIFO and a second core
  std::function<bool()> stop = [] { return false; };                            // asked by the viewer's thread
  std::function<void(const ViewerFrame&)> view = [](const ViewerFrame&) {};     // on the viewer's thread
  std::function<void(const TickRecord&)> on_tick = [](const TickRecord&) {};    // on the viewer's thread, in order
  std::function<void(const SolveRecord&)> on_solve = [](const SolveRecord&) {}; // likewise, before ticks that use it
  bool keep = true;          // ticks and solves for the returned records; false: on_tick and on_solve alone see them
  bool solve_at_rest = true; // false: none is begun while device and tears stay as they were in the last
  /// Nodes that follow the tool are made in the background, as what follows a blade is.
  bool follow_in_background = false;
  int niceness = 0;           // of the simulation thread and those that it makes: who else runs here goes before them
  double most_solves = 0;     // begun a second; 0: as many as there is time for
  ViewerFeed* feed = nullptr; // in place of one of the loop's own; then `view` is not called
};

/// Runs for `duration` seconds; with `keep` off that may be infinite, and memory stays bounded. Ticks that come late
/// are made up at once, each with its own number, so that time in the loop is time on the clock; all of them are
/// counted. Throws what preparing throws; a solve that fails later is in its record, and the loop goes on with the
/// snapshot it has. What a function of `options` throws ends the session and is thrown on. The haptic thread hands its
/// ticks to the viewer's through a ring of ring_seconds.
inline constexpr double ring_seconds = 16;
LoopRecords run_realtime(const HapticSettings& settings, HapticSimulation& simulation, Device& device, double duration,
                         const RealtimeOptions& options, RealtimeReport& report);

} // namespace spherecut::app
