// A haptic session on disk: what came in from the device at every tick, what went out to it, and which solve was begun
// and taken over when. Enough to run the session again, bit by bit (replay.hpp). docs/haptics.md has the layout.
#pragma once

#include "src/base/output_file.hpp"
#include "src/haptics/loop_records.hpp"
#include "src/scenario/scenario.hpp"

#include <optional>

namespace spherecut::app {

/// Written. Read are all from 1 on; torques came with 2, a second hand with 3.
inline constexpr std::uint32_t recording_version = 3;

/// What a recording is of.
struct RecordingHeader {
  std::string build;              // version and identity of the program
  std::string processor;          // that it ran on
  std::filesystem::path scenario; // absolute: files that the scenario names are looked for beside it
  std::string scenario_text;      // of the file
  std::uint64_t seed = 0;         // of the nodes
  std::uint64_t organ = 0;        // topology::surface_hash of the organ at rest
  double rate = 0;                // ticks per second
};

/// Header of a session of this scenario by this program.
RecordingHeader recording_header(const Scenario& scenario, const topology::SurfaceMesh& organ);

/// Writes as the session goes: a few hundred ticks at a time, each lot whole on disk before the next, so that a session
/// that is killed keeps all but the last. From one thread, not the haptic one.
class RecordingWriter {
 public:
  /// Throws InputError when the file cannot be written, as do the others.
  RecordingWriter(std::filesystem::path file, const RecordingHeader& header);
  void add(const TickRecord& tick);
  void add(const SolveRecord& solve);
  /// Brings to disk what has been added.
  void flush();
  /// Ends the file. `lost`: ticks that could not be kept; the recording cannot be replayed when there are any.
  void finish(std::uint64_t lost = 0);

 private:
  void write(std::uint32_t kind, std::string& payload);
  OutputFile file_;
  std::string ticks_, solves_, clients_, seconds_, second_clients_;
  std::uint64_t tick_count_ = 0, solve_count_ = 0;
  bool two_hands_told_ = false;
};

/// What a hand did and felt at a tick.
struct RecordedHand {
  DeviceState device;
  Vector3 force = Vector3::Zero();  // N, on the hand
  Vector3 torque = Vector3::Zero(); // N m, on the hand; zero in version 1
};

/// A tick as recorded.
struct RecordedTick : RecordedHand {
  std::uint64_t sequence = 0; // of the snapshot in use
};

struct Recording {
  std::uint32_t version = recording_version; // of the format
  RecordingHeader header;
  std::vector<RecordedTick> ticks;
  std::vector<SolveRecord> solves; // event, failed, resprinkled, cut_triangles, nodes, topology, force, torque
  bool finished = false;           // false: the session was killed; everything up to its last lot is here

  /// Of the second hand, at ticks at which it held the blade, in their order.
  std::vector<RecordedHand> seconds;
  bool two_hands = false; // there was a second device
  /// Null: the second hand held nothing then.
  [[nodiscard]] const RecordedHand* second_at(std::uint64_t tick) const;
};

/// Throws InputError, naming the place, when the file is not a recording, of a newer version, cut off within a lot,
/// damaged or incomplete.
Recording read_recording(const std::filesystem::path& file);

/// A recorded motion as a device: the poses of its ticks, then the last one for ever; the force is not felt.
class RecordedMotion : public Device {
 public:
  /// Throws InputError when the recording is empty or of another rate.
  RecordedMotion(const Recording& recording, double rate, WhichHand hand = WhichHand::first);
  DeviceState read(std::uint64_t tick) noexcept override;
  void apply(const Vector3& /*force*/) noexcept override {}

 private:
  std::vector<DeviceState> states_;
  double rate_;
};

} // namespace spherecut::app
