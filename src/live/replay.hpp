// A recorded session run again off line, and what differs.
#pragma once

#include "src/live/recording.hpp"
#include "src/live/virtual_loop.hpp"

namespace spherecut::app {

/// What a replay found. Forces and, where the recording has them, torques are compared by their bits, at every tick and
/// for both hands; of solves these, the nodes, the hash of the topology, and whether they failed.
struct ReplayReport {
  std::size_t ticks = 0, solves = 0; // compared
  std::optional<std::uint64_t> differing_tick;
  std::optional<std::uint64_t> differing_solve;
  std::size_t differing_ticks = 0;
  double largest = 0;        // N, of the differences between forces on the hand
  double largest_torque = 0; // N m, likewise
  bool torques = true;       // recorded
  bool two_hands = false;    // a second hand has held the blade
  bool same_build = true, same_processor = true;
  [[nodiscard]] bool same() const { return !differing_tick && !differing_solve; }
};

/// As lines for a screen.
std::string text_of(const ReplayReport& report);

/// The scenario of a recording. Throws InputError as read_scenario.
Scenario recorded_scenario(const Recording& recording);

/// Runs the recording through the loop in virtual time: its poses, and its solves at the ticks at which they began and
/// were taken over. `simulation`, of recorded_scenario(), must not have moved yet. Throws InputError when the
/// recording is empty or its organ is another one.
ReplayReport replay(
    const Recording& recording, HapticSimulation& simulation, LoopRecords& records,
    const std::function<bool()>& stop = [] { return false; });

} // namespace spherecut::app
