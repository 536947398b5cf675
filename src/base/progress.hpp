// Progress of a run: a bar on a terminal, plain lines elsewhere.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>

namespace spherecut::app {

class Progress {
 public:
  /// Writes to `out`, with a bar when that is a terminal.
  explicit Progress(std::FILE* out);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A line that stays, as printable() has it.
  void say(const std::string& line);
  /// `done` of `total` steps, with a word on the last one. Elsewhere than on a terminal about ten lines in all.
  void step(std::size_t done, std::size_t total, const std::string& word);

 private:
  void clear_bar();
  std::FILE* out_;
  bool terminal_;
  bool bar_shown_ = false;
  std::size_t tenths_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

} // namespace spherecut::app
