// The command `spherecut haptics`: a scenario in the hand, in real time.
#pragma once

#include "src/live/simulation.hpp"
#include "src/run/run.hpp"

#include <memory>

namespace spherecut::app {

struct HapticCommand {
  std::filesystem::path scenario, out;
  std::filesystem::path replay; // a recording to run again and compare, in place of a scenario; empty: none
  double duration = 10;         // s
  bool bench = false;           // four manoeuvres of the device that the scenario states, or of a hand without one
  bool in_virtual_time = false; // a solve every budget, each taking all of it; the same bits every time
  int solved_stride = 10;       // the solved force is recomputed at every so many ticks; 0: not
};

/// Runs, records, writes and prints. Throws InputError and NumericalError.
RunEnd run_haptics(const HapticCommand& command, std::FILE* screen);

/// The device that the settings name, on a path: that of the scenario's tool or blade. Throws InputError as
/// read_recording, BridgeDevice and HaplyDevice.
std::unique_ptr<Device> make_device(const HapticSettings& settings, const std::vector<PathPose>& path);
std::unique_ptr<Device> make_device(const HapticSettings& settings, const HapticSimulation& simulation);
/// That of a second hand, on the path of the blade; null: there is none. Throws as make_device.
std::unique_ptr<Device> make_second_device(const HapticSettings& settings, const HapticSimulation& simulation);

} // namespace spherecut::app
