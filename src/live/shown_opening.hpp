// How far a cut is open in a picture of it.
#pragma once

#include "src/live/surface_follower.hpp"

namespace spherecut::app {

struct ShownOpening {
  double largest = 0; // m, distance between the faces along their normal at rest; 0 where they are closed
  double volume = 0;  // m3, between the faces
};

/// Of a surface whose vertices have moved to `deformed`, m.
ShownOpening shown_opening(const ViewerTopology& surface, const std::vector<Eigen::Vector3f>& deformed);

} // namespace spherecut::app
