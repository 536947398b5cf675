// What a manoeuvre in the hand was like, in figures that owners of devices can compare (docs/haptics.md). Of readings
// and forces alone: no session, no device.
#pragma once

#include "topology/base/types.hpp"

#include <optional>
#include <vector>

namespace spherecut::app {

/// Readings and forces of a manoeuvre, one a tick.
struct BenchSeries {
  double rate = 1000;             // ticks per second
  std::vector<Vector3> positions; // m, as the device reads them
  std::vector<Vector3> forces;    // N, sent to the hand at that tick; it has them until the next
  int delay = 0;                  // ticks by which they act late
};

/// None where a manoeuvre does not have it: without a force all, of a tap what needs a settled force.
struct BenchFigures {
  std::optional<double> settled;   // N, mean over the last third of the contact
  double peak = 0;                 // N
  std::optional<double> rise;      // s, from 10 to 90 % of the settled force; of a tap, of the peak
  std::optional<double> overshoot; // by which the force was above the settled one before, as a share of it
  /// N, RMS about the mean over 0.1 s, in the last third; of a tap, about that over 0.02 s in all of the contact.
  std::optional<double> oscillation;
  double injected = 0;        // J, most that the hand had got from the loop above what it had put in
  std::optional<double> jerk; // m/s3, RMS over the contact, of the cubic that fits 0.05 s of readings best
};

/// The contact is from the first to the last tick with a twentieth of the peak force or more. `holds` false: a tap,
/// whose force does not settle. Throws InputError unless there is a force for each position, a positive rate and a
/// delay of 0 or more.
BenchFigures bench_figures(const BenchSeries& series, bool holds);

} // namespace spherecut::app
