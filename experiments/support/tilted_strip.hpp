// A flat bar that stands askew between the axes, in plane strain between two sliding sides.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "experiments/support/cut_body.hpp"

namespace spherecut::experiments {

/// Turned about the y axis by 0.23 rad and shifted; sides at y = +-thickness / 2.
struct TiltedStrip {
  std::shared_ptr<const topology::Domain> domain;
  CutFrame frame;                               // of its centre: `ahead` along its length, `normal` along its height
  double length = 0, height = 0, thickness = 0; // m
};

TiltedStrip tilted_strip(double length, double height, double thickness, double edge);

/// A cut across the whole thickness, from beyond the end `-ahead` to the distance `depth` m inside it, at `above` m
/// over the middle.
topology::SurfaceMesh cut_from_end(const TiltedStrip& strip, double depth, double above, double edge);

/// Sliding sides, and the rigid motions in the plane held at two nodes near the far end: for loads in balance.
void hold_sides(solvers::Problem& problem, const TiltedStrip& strip);

} // namespace spherecut::experiments
