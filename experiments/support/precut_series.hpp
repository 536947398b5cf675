// Errors of one configuration over its seeds, and the checks on their median and worst.
#pragma once

#include "experiments/experiment.hpp"

#include <map>
#include <string>
#include <vector>

namespace spherecut::experiments {

/// Named errors, one value a seed.
class ErrorSeries {
 public:
  void add(const std::string& name, double value) { values_[name].push_back(value); }
  [[nodiscard]] const std::vector<double>& operator[](const std::string& name) const { return values_.at(name); }
  /// "PREFIX_NAME" <= bound for the median and, from three seeds on, "PREFIX_NAME_worst" <= 2 bound.
  void check(const std::string& prefix, const std::string& name, double bound, std::vector<Check>& checks) const;
  /// "name median (worst), ..." in percent.
  [[nodiscard]] std::string text() const;

 private:
  std::map<std::string, std::vector<double>> values_;
};

} // namespace spherecut::experiments
