// How nodes and system of equations followed an increment of a cut, a blade's or a tear's.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace spherecut::app {

enum class SystemUpdate : std::uint8_t {
  none,       // nothing was cut
  updated,    // what the cut appends was computed alone
  taken_over, // made in the background
  rebuilt,    // from scratch
};
std::string_view to_string(SystemUpdate update);

/// Wall clock of the stages, s.
struct RebuildSeconds {
  double topology = 0, level_sets = 0, visibility = 0, sprinkling = 0, assembly = 0, solve = 0;
};

struct BodyUpdate {
  SystemUpdate update = SystemUpdate::none;
  std::string update_reason;     // why not merely updated
  bool has_grown = false;        // updated in the step, or taken over as a copy that has grown beside it
  int nodes = 0, kept_nodes = 0; // kept: with the place they had before
  RebuildSeconds seconds;
};

} // namespace spherecut::app
