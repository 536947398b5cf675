// A crack within a box whose surface is held at a known field, pressed open from within.
#pragma once

#include "experiments/support/cut_body.hpp"
#include "experiments/support/precut_series.hpp"

#include <functional>
#include <memory>

namespace spherecut::experiments {

struct PressedCrack {
  std::shared_ptr<const topology::Domain> domain;
  topology::SurfaceMesh sheet;
  double fine = 0, coarse = 0; // m, spacing at the front; far from it, over that at it
  solvers::Material material;
  double pressure = 0;                               // Pa, on both faces
  std::function<Vector3(const Vector3&)> at_surface; // m, displacement of the box's surface
};

/// The whole problem on the nodes of that seed.
solvers::Problem pressed_crack(const PressedCrack& crack, int seed, const PrecutMethod& method);

} // namespace spherecut::experiments
