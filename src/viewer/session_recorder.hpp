// Writes a live session to a file as it goes on, and tells what could not be written.
#pragma once

#include "src/live/recording.hpp"

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace spherecut::app {

/// Failures of a session, noted by its threads and told by the viewer's.
class FailureList {
 public:
  void add(std::string failure);
  /// Unless it is the one that this was last called with.
  void add_once(const std::string& reason);
  /// Those since the last call.
  [[nodiscard]] std::vector<std::string> take();

 private:
  std::mutex mutex_;
  std::vector<std::string> failures_; // guarded
  std::string last_;                  // guarded; reason
};

/// add() and end() are the loop's; the others are for any thread. Does nothing where there is no file. A recording that
/// cannot be written any more ends, the failure is noted, and the session goes on. It ends after an hour.
class SessionRecorder {
 public:
  explicit SessionRecorder(FailureList& failures) : failures_(failures) {}
  /// Before the loop begins. Throws InputError when the file cannot be written.
  void begin(const std::filesystem::path& file, const RecordingHeader& header);

  [[nodiscard]] bool recording() const { return recording_; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// The file is whole soon after, when recording() is false.
  void stop() { stop_ = true; }

  void add(const TickRecord& record);
  void add(const SolveRecord& record);
  /// `lost`: ticks that could not be kept.
  void end(std::uint64_t lost);

 private:
  FailureList& failures_;
  std::filesystem::path file_;
  std::unique_ptr<RecordingWriter> writer_; // the loop's; null: nothing is recorded
  std::atomic<bool> recording_{false}, stop_{false};
};

} // namespace spherecut::app
