#include "experiments/support/precut_series.hpp"

#include "experiments/support/statistics.hpp"

#include <fmt/format.h>

namespace spherecut::experiments {

void ErrorSeries::check(const std::string& prefix, const std::string& name, double bound,
                        std::vector<Check>& checks) const {
  const std::vector<double>& errors = values_.at(name);
  checks.push_back({prefix + "_" + name, median(errors), "<=", bound});
  if (errors.size() > 2)
    checks.push_back({prefix + "_" + name + "_worst", largest(errors), "<=", 2 * bound});
}

std::string ErrorSeries::text() const {
  std::string line;
  for (const auto& [name, errors] : values_)
    line += fmt::format("{}{} {:.2f} ({:.2f})", line.empty() ? "" : ", ", name, 100 * median(errors),
                        100 * largest(errors));
  return line + " %";
}

} // namespace spherecut::experiments
