// One run of the flat punch against the exact solution.
#pragma once

#include "experiments/support/half_space_contact.hpp"

namespace spherecut::experiments {

inline constexpr double punch_depth = 1e-6 * contact_radius;

struct PunchRun {
  HalfSpaceBody body;
  double force_ratio = 0;   // over exact
  double profile_error = 0; // largest from a + h to 3 a, in units of the depth
  double imbalance = 0;     // of contact and far boundary force
  double press_seconds = 0;
  std::vector<SurfaceSample> profile;
};

/// Takes a case with Indenter::punch.
PunchRun press_punch(const HalfSpaceCase& half_space);

} // namespace spherecut::experiments
