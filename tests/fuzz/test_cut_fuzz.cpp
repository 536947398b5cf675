// Random and degenerate blades on all organs of cut_fuzz; SPHERECUT_FUZZ_COUNT blades in all (210),
// SPHERECUT_FUZZ_FIRST the first.
#include "experiments/cut_fuzz/fuzz.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <iostream>
#include <string>

using namespace spherecut;
using namespace spherecut::experiments;

namespace {

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::stoi(text);
}

} // namespace

TEST_CASE("Random and degenerate blades leave every wound closed, manifold, of the same volume, however it grew") {
  const int count = from_environment("SPHERECUT_FUZZ_COUNT", 210), first = from_environment("SPHERECUT_FUZZ_FIRST", 0);
  FuzzOutcome total;
  const std::vector<FuzzOrgan> organs = fuzz_organs();
  const int each = (count + static_cast<int>(organs.size()) - 1) / static_cast<int>(organs.size());
  for (const FuzzOrgan& organ : organs)
    add(total, cut_fuzz(organ, first, each));
  for (const std::string& failure : total.failures)
    FAIL_CHECK(failure);
  CHECK(total.refused == 0);
  CHECK(total.worst_volume <= 1e-9);
  CHECK(total.worst_piece <= 1e-12);
  // The blades are not idle.
  CHECK(total.opened > total.blades / 2);
  if (total.blades >= 100) {
    CHECK(total.severed > total.blades / 20);
    CHECK(total.kinds.size() == 13);
  }
  std::cout << total.blades << " blades in " << total.stages << " stages: " << total.opened << " opened, "
            << total.severed << " severed, at most " << total.most_pieces << " pieces, volume to " << total.worst_volume
            << ", piece volumes to " << total.worst_piece << "\n";
}
