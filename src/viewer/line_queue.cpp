#include "src/viewer/line_queue.hpp"

#include <utility>

namespace spherecut::app {
namespace {

constexpr std::size_t most_lines = 200;
constexpr auto line_interval = std::chrono::milliseconds(100);

} // namespace

void LineQueue::add(const std::string& line) {
  const std::lock_guard lock(mutex_);
  if (lines_.size() >= most_lines)
    lines_.pop_front();
  lines_.push_back(line);
}

std::optional<std::string> LineQueue::next() {
  const auto now = std::chrono::steady_clock::now();
  if (now - told_ < line_interval)
    return std::nullopt;
  const std::lock_guard lock(mutex_);
  if (lines_.empty())
    return std::nullopt;
  std::string line = std::move(lines_.front());
  lines_.pop_front();
  told_ = now;
  return line;
}

} // namespace spherecut::app
