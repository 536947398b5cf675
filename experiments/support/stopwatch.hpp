// Processor time of an experiment's stages: reported, never checked. Unlike wall clock it hardly depends on what else
// runs on the machine.
#pragma once

#include <ctime>

namespace spherecut::experiments {

class Stopwatch {
 public:
  /// Seconds of processor time of the whole program since construction.
  [[nodiscard]] double seconds() const { return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

} // namespace spherecut::experiments
