// `spherecut haptics --bench`: a stiff press, a tap, a slide and a cut with the device that a scenario states, and what
// each was like in figures (bench_figures.hpp).
#pragma once

#include "src/haptics/device.hpp"
#include "src/haptics/loop_records.hpp"
#include "src/live/bench_figures.hpp"
#include "src/scenario/scenario.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace spherecut::app {

/// One of the four, on a block of its own. A simulated device follows `path` for `seconds`; with another a hand does
/// what `asks` says.
struct Manoeuvre {
  std::string name, asks;
  Scenario scenario;
  std::vector<PathPose> path;
  double seconds = 0;
  bool holds = true; // the force settles
};

/// The four, with rates, model, device and limits as given.
std::vector<Manoeuvre> bench_manoeuvres(const HapticSettings& settings);

/// What was recorded of a manoeuvre, as its figures take it.
BenchSeries bench_series(const HapticSettings& settings, const LoopRecords& records);

struct BenchResult {
  std::string name;
  BenchFigures figures;
};

/// As a table for a screen, with units.
std::string bench_table(const std::vector<BenchResult>& results);

/// haptic_bench.json. Throws InputError when it cannot be written.
void write_bench(const std::filesystem::path& folder, const HapticSettings& settings,
                 const std::vector<BenchResult>& results);

} // namespace spherecut::app
