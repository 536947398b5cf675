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
  int beyond = 0;                      // a displacement above the organ's size
  double largest = 0;                  // displacement where none above the organ's size was told, in such sizes
  std::map<std::string, int> reasons;  // of refusals: the words without their numbers
  std::vector<std::string> failures{}; // organ, number, kind, what is wrong
};

/// Each blade's last stage as precuts of the organ, which is held at its base and sags: solved as `spherecut
/// run` does, with nodes 10 mm apart, 5 mm in walls, from files in `folder`. Blades number `first` to
/// first + count - 1.
SolvedOutcome solve_cuts(const FuzzOrgan& organ, int first, int count, const std::filesystem::path& folder);

/// Adds one outcome to another.
void add(SolvedOutcome& total, const SolvedOutcome& more);

} // namespace spherecut::experiments
