// Whether bodies with random and degenerate cuts give an answer of their size, or a clear word.
#pragma once

#include "experiments/cut_fuzz/blades.hpp"

#include <filesystem>
#include <map>

namespace spherecut::experiments {

struct SolvedOutcome {
  int blades = 0, solved = 0;
  int refused = 0;                     // with a message
  int warned = 0;                      // solved, and something was said
  int beyond = 0;                      // a displacement above the organ's size, and it was said
  double largest = 0;                  // of a displacement that nobody was warned of, in sizes of the organ
  std::map<std::string, int> reasons;  // of refusals: the words without their numbers
  std::vector<std::string> failures{}; // organ, number, kind, what is wrong
};

/// Each blade's last stage as precuts of the organ, which hangs by a part of its surface and sags: solved as `spherecut
/// run` does, with nodes about an eighth of the organ's size apart, from files in `folder`. Blades number `first` to
/// first + count - 1.
SolvedOutcome solve_cuts(const FuzzOrgan& organ, int first, int count, const std::filesystem::path& folder);

/// Adds one outcome to another.
void add(SolvedOutcome& total, const SolvedOutcome& more);

} // namespace spherecut::experiments
