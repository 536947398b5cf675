// Lines that sessions say on threads of their own, told to viewers one after the other.
#pragma once

#include <chrono>
#include <deque>
#include <mutex>
#include <optional>
#include <string>

namespace spherecut::app {

class LineQueue {
 public:
  /// From any thread. Of more than 200 lines that wait the oldest are dropped.
  void add(const std::string& line);
  /// The oldest line that waits, 100 ms after the one before at the earliest.
  [[nodiscard]] std::optional<std::string> next();

 private:
  std::mutex mutex_;
  std::deque<std::string> lines_; // guarded
  std::chrono::steady_clock::time_point told_;
};

} // namespace spherecut::app
