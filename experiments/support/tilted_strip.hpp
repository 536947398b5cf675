// A flat bar that stands askew between the axes, in plane strain.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "experiments/support/cut_body.hpp"

namespace spherecut::experiments {

/// What keeps it in plane strain. Sliding sides stand on y = +-thickness / 2, the bar is turned about the y axis by
/// 0.23 rad and shifted. With free sides it is turned about all three axes, aligned with nothing; it is in plane strain
/// when nu = 0.
enum class StripSides { sliding, free };

struct TiltedStrip {
  std::shared_ptr<const topology::Domain> domain;
  CutFrame frame; // of its centre: `ahead` along its length, `normal` along its height
  StripSides sides = StripSides::sliding;
  double length = 0, height = 0, thickness = 0; // m
};

TiltedStrip tilted_strip(double length, double height, double thickness, double edge, StripSides sides,
                         Placement placement = Placement::tilted);

/// A cut across the whole thickness, from beyond the end `-ahead` to the distance `depth` m inside it, at `above` m
/// over the middle.
topology::SurfaceMesh cut_from_end(const TiltedStrip& strip, double depth, double above, double edge);

/// The sides, and the rigid motions that they leave at nodes near the far end: for loads in balance.
void hold_strip(solvers::Problem& problem, const TiltedStrip& strip);

} // namespace spherecut::experiments
