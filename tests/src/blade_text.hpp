// A blade as it stands in a scenario.
#pragma once

#include <string>
#include <vector>

namespace spherecut::tests {

/// A blade with its edge along y, from pose to pose.
inline std::string blade(const std::vector<std::string>& positions, double half_length, const std::string& step) {
  std::string text = "[blade]\nedge = [[0, " + std::to_string(-half_length) + ", 0], [0, " +
                     std::to_string(half_length) + ", 0]]\nstep = " + step + "\n";
  int time = 0;
  for (const std::string& position : positions)
    text += "[[blade.path]]\ntime = " + std::to_string(time++) + "\nposition = " + position + "\n";
  return text;
}

} // namespace spherecut::tests
