// Stored solution of a cut block that is stretched, by CalculiX (reference_calculix.py).
#pragma once

#include <string>
#include <vector>

namespace spherecut::experiments {

/// The block is 1 m wide, 1 m high and 0.5 m deep, mu = 1 Pa; its ends are bonded and moved apart.
struct GapingReference {
  struct Place {
    double x = 0, z = 0;                    // m: into the cut from its mouth, and from the middle of the block
    double opening = 0, coarse_opening = 0; // m, u+ - u- across the cut, by the finer and by the coarser elements
  };
  struct Stretch {
    double stretch = 0; // 1.2, 1.4
    double force = 0;   // N, of a grip
    double force_change = 0,
           opening_change = 0; // between the two meshes, relative to the force and the largest opening
    std::vector<Place> places{};
  };
  std::string source;
  std::vector<Stretch> stretches;
};

/// The stored table. Throws InputError where it cannot be read.
GapingReference load_gaping_reference();

} // namespace spherecut::experiments
