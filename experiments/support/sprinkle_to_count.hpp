// Sprinkling to a number of nodes where the seeds themselves depend on the spacing.
#pragma once

#include "solvers/nodes/nodes.hpp"

#include <functional>

namespace spherecut::experiments {

struct CountedSprinkling {
  solvers::Sprinkling sprinkling;
  double fine = 0; // m, spacing in the fine zone
};

/// Options for a given fine spacing (m).
using OptionsForSpacing = std::function<solvers::SprinkleOptions(double fine)>;

/// Searches the fine spacing for a cloud of about `target` nodes, by bisection of its logarithm about `guess` (m);
/// stops within 2 % or after ten fillings and returns the nearest. Throws NumericalError when none of them fills the
/// domain.
CountedSprinkling sprinkle_to_count(const topology::Domain& domain, const OptionsForSpacing& options, int target,
                                    double guess);

} // namespace spherecut::experiments
