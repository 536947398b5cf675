// Wall clock of an experiment's stages: reported, never checked.
#pragma once

#include <chrono>

namespace spherecut::experiments {

class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

} // namespace spherecut::experiments
