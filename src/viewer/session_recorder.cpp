#include "src/viewer/session_recorder.hpp"

#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr std::uint64_t flush_ticks = 256;               // between two writes of a recording
constexpr std::uint64_t most_recorded_ticks = 3'600'000; // an hour: then it ends

} // namespace

void FailureList::add(std::string failure) {
  const std::lock_guard lock(mutex_);
  failures_.push_back(std::move(failure));
}

void FailureList::add_once(const std::string& reason) {
  const std::lock_guard lock(mutex_);
  if (std::exchange(last_, reason) != reason)
    failures_.push_back(reason);
}

std::vector<std::string> FailureList::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failures_, {});
}

void SessionRecorder::begin(const std::filesystem::path& file, const RecordingHeader& header) {
  file_ = file;
  writer_ = std::make_unique<RecordingWriter>(file, header);
  recording_ = true;
}

void SessionRecorder::add(const TickRecord& record) {
  if (writer_ == nullptr)
    return;
  const bool full = record.device.tick >= most_recorded_ticks;
  try {
    writer_->add(record);
    if (record.device.tick % flush_ticks == flush_ticks - 1)
      writer_->flush();
  } catch (const InputError& error) {
    failures_.add(fmt::format("the recording has ended: {}", error.what()));
    writer_.reset();
    recording_ = false;
  }
  if (full || stop_)
    end(0);
}

void SessionRecorder::add(const SolveRecord& record) {
  if (writer_ != nullptr)
    writer_->add(record);
}

void SessionRecorder::end(std::uint64_t lost) {
  if (writer_ == nullptr)
    return;
  try {
    writer_->finish(lost);
  } catch (const InputError& error) {
    failures_.add(fmt::format("the recording could not be ended: {}", error.what()));
  }
  writer_.reset();
  recording_ = false;
}

} // namespace spherecut::app
