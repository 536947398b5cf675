// The threads about the tick: the haptic thread at its rate, the simulation thread as fast as it can, and the caller's
// own as the viewer. Nothing but triple buffers lies between them.
#pragma once

#include "src/haptics/loop_records.hpp"
#include "src/haptics/viewer_feed.hpp"

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
  bool stopped = false; // before its time
};

struct RealtimeOptions {
  bool fifo = true;   // ask for SCHED_FIFO
  double spin = 1e-4; // s before a tick is due from which the thread spins; only with SCHED_FIFO and a second core
  std::function<bool()> stop = [] { return false; };                        // asked by the viewer's thread
  std::function<void(const ViewerFrame&)> view = [](const ViewerFrame&) {}; // on the viewer's thread
};

/// Runs for `duration` seconds. Ticks that come late are made up at once, each with its own number, so that time in the
/// loop is time on the clock; all of them are counted. Throws what preparing throws; a solve that fails later is in its
/// record, and the loop goes on with the snapshot it has.
LoopRecords run_realtime(const HapticSettings& settings, HapticSimulation& simulation, Device& device, double duration,
                         const RealtimeOptions& options, RealtimeReport& report);

} // namespace spherecut::app
