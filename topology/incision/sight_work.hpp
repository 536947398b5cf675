// Work of sight lines, counted: the same on a slow or busy machine.
#pragma once

#include <cstdint>

namespace spherecut::topology {

/// So many sight lines of this thread have gone through the tree of an incision's triangles so far: those that no
/// triangle known from another line of the same eye blocks. Take differences.
std::uint64_t sight_lines_walked();

} // namespace spherecut::topology
