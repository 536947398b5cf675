// Numbers of a haptic session, and the files that keep them.
#pragma once

#include "src/devices/bridge_device.hpp"
#include "src/devices/haply_device.hpp"
#include "src/live/realtime_loop.hpp"
#include "src/live/virtual_loop.hpp"

#include <filesystem>

namespace spherecut::app {

/// Values that a share of the samples stay at or below.
struct Percentiles {
  double p50 = 0, p99 = 0, p999 = 0, largest = 0;
};
Percentiles percentiles(std::vector<double> samples);

/// Largest step of the force on the hand between two ticks, N: anywhere, and by what happens at the tick.
struct ForceSteps {
  double any = 0, hand_over = 0, onset = 0, cut = 0;
};
ForceSteps force_steps(const LoopRecords& records);

/// Of the tissue force against the solved one.
struct ModelError {
  double rms = 0, largest = 0; // N, over the ticks in contact
  double peak = 0;             // N, of the solved force
  std::size_t ticks = 0;       // compared
};
ModelError model_error(const std::vector<TickRecord>& ticks, const std::vector<SolvedForce>& solved);

/// Of the second hand, over the ticks in which it held the blade.
struct SecondHandFindings {
  std::size_t ticks = 0;
  double peak = 0, peak_torque = 0;     // N, N m, on the hand
  double step = 0;                      // N, largest between two ticks on end
  double energy = 0, lowest_energy = 0; // J, at its port
  std::uint64_t limited = 0;            // ticks
  std::optional<BridgeCounters> bridge; // with that device
  std::optional<HaplyCounters> haply;   // likewise
};

struct HapticFindings {
  RealtimeReport loop;
  double rate = 0;       // ticks per second, over the session
  double tick_rate = 0;  // ticks per second of the scenario
  double solve_rate = 0; // solves per second
  Percentiles latency;   // s, from due to begun
  Percentiles compute;   // s, processor time of a tick
  Percentiles solve;     // s
  ForceSteps steps;
  ModelError error;
  double peak = 0;                      // N, on the hand
  double peak_torque = 0;               // N m, likewise
  double energy = 0, lowest_energy = 0; // J, at the port
  std::uint64_t failed = 0, resprinkled = 0, swaps = 0, increments = 0, outside = 0, unconverged = 0, limited = 0;
  std::uint64_t softened = 0;         // ticks
  double blade_peak = 0;              // N, of the solves
  double blade_peak_torque = 0;       // N m, likewise
  solvers::BladeLedger blade_account; // J, at the last solve
  double resprinkle_jump = 0;         // largest, as a share of the force
  double cut_area = 0;                // m2, of the last solve's body
  bool unfollowed = false;            // at the end that had yet to follow the blade (blade.advance)
  int highest_degradation = 0;
  std::optional<BridgeCounters> bridge; // with that device
  std::optional<HaplyCounters> haply;   // likewise
  SecondHandFindings second;
};
HapticFindings findings_of(const HapticSettings& settings, const LoopRecords& records, const RealtimeReport& report);

/// What a client's rate means for its force, as a line for a screen; and why one has none.
std::string pace_text(const PaceReading& pace, const std::string& client = "bridge: the client");
/// What is left of an Inverse3, likewise.
std::string link_text(HaplyLink link, const HaplySettings& settings);
std::string too_slow_text(double rate);

/// As lines for a screen.
std::string text_of(const HapticFindings& findings);

/// haptic_ticks.csv, haptic_second.csv where a second hand has held the blade, haptic_solves.csv, haptic_deadlines.csv
/// (histograms of latency and compute time), haptic.json. Throws InputError when a file cannot be written.
void write_haptics(const std::filesystem::path& folder, const LoopRecords& records, const HapticFindings& findings,
                   const std::vector<SolvedForce>& solved);

} // namespace spherecut::app
