#include "experiments/support/statistics.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::experiments {

double median(std::vector<double> values) {
  if (values.empty())
    throw InputError("the median of no values");
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double largest(const std::vector<double>& values) {
  if (values.empty())
    throw InputError("the largest of no values");
  return *std::max_element(values.begin(), values.end());
}

double log_log_slope(const std::vector<double>& x, const std::vector<double>& y) {
  if (x.size() != y.size() || x.size() < 2)
    throw InputError("a slope needs two points or more");
  const auto count = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += std::log(x[k]) / count;
    mean_y += std::log(y[k]) / count;
  }
  double above = 0, below = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    above += (std::log(x[k]) - mean_x) * (std::log(y[k]) - mean_y);
    below += (std::log(x[k]) - mean_x) * (std::log(x[k]) - mean_x);
  }
  return above / below;
}

} // namespace spherecut::experiments
