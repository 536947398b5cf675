// Small statistics over random seeds and refinements.
#pragma once

#include <vector>

namespace spherecut::experiments {

/// Middle value, the mean of the two middle ones for an even count. Throws InputError for none.
double median(std::vector<double> values);

/// Throws InputError for none.
double largest(const std::vector<double>& values);

/// Slope of the straight line that fits log y against log x best. Needs two points or more, all positive.
double log_log_slope(const std::vector<double>& x, const std::vector<double>& y);

} // namespace spherecut::experiments
