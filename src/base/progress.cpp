#include "src/base/progress.hpp"

#include "src/base/printable.hpp"

#include <fmt/format.h>
#include <unistd.h>

namespace spherecut::app {
namespace {

constexpr std::size_t bar_width = 30;

} // namespace

Progress::Progress(std::FILE* out) : out_(out), terminal_(isatty(fileno(out)) == 1) {}

Progress::~Progress() {
  clear_bar();
  std::fflush(out_);
}

void Progress::say(const std::string& line) {
  clear_bar();
  std::fputs((printable(line) + "\n").c_str(), out_);
  std::fflush(out_);
}

void Progress::step(std::size_t done, std::size_t total, const std::string& word) {
  if (total == 0)
    return;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  if (terminal_) {
    const std::size_t filled = bar_width * done / total;
    const double left = done > 0 ? seconds * static_cast<double>(total - done) / static_cast<double>(done) : 0;
    clear_bar();
    const std::string bar = fmt::format("[{}{}] {}/{}  {}  {:.0f} s left", std::string(filled, '#'),
                                        std::string(bar_width - filled, '.'), done, total, word, left);
    std::fputs(bar.c_str(), out_);
    std::fflush(out_);
    bar_shown_ = true;
  } else if (const std::size_t tenths = 10 * done / total; tenths > tenths_ || done == total) {
    tenths_ = tenths;
    say(fmt::format("step {} of {}, {}, {:.1f} s", done, total, word, seconds));
  }
}

void Progress::clear_bar() {
  if (bar_shown_)
    std::fputs("\r\033[K", out_);
  bar_shown_ = false;
}

} // namespace spherecut::app
