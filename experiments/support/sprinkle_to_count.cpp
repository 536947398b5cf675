#include "experiments/support/sprinkle_to_count.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <string>

namespace spherecut::experiments {

CountedSprinkling sprinkle_to_count(const topology::Domain& domain, const OptionsForSpacing& options, int target,
                                    double guess) {
  CountedSprinkling best;
  double nearest = std::numeric_limits<double>::infinity();
  // The count falls as the spacing grows: bracket the target, then bisect the logarithm.
  double fine = guess, below = 0, above = 0; // spacings known to be too small, too large
  std::string failure;
  for (int attempt = 0; attempt < 10; ++attempt) {
    int count = 0;
    try {
      solvers::Sprinkling sprinkling = solvers::sprinkle(domain, options(fine));
      count = sprinkling.nodes.size();
      const double miss = std::abs(count - target);
      if (miss < nearest) {
        nearest = miss;
        best = {std::move(sprinkling), fine};
      }
    } catch (const NumericalError& error) {
      failure = error.what(); // under-filled: too coarse for its surroundings
    }
    if (nearest <= 0.02 * target)
      break;
    (count > target ? below : above) = fine;
    if (below > 0 && above > 0)
      fine = std::sqrt(below * above);
    else
      fine *= count > 0 ? std::clamp(std::pow(static_cast<double>(count) / target, 0.6), 0.6, 1.7) : 0.7;
  }
  if (!std::isfinite(nearest))
    throw NumericalError(
        fmt::format("no spacing near {} m fills the domain with about {} nodes: {}", guess, target, failure));
  return best;
}

} // namespace spherecut::experiments
