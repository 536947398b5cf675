// Errors of one configuration over its seeds, and the checks on their median and worst.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "experiments/experiment.hpp"

#include "solvers/body/discretisation.hpp"

#include <map>
#include <string>
#include <vector>

namespace spherecut::experiments {

/// Named errors, one value a seed.
class ErrorSeries {
 public:
  void add(const std::string& name, double value) { values_[name].push_back(value); }
  [[nodiscard]] const std::vector<double>& operator[](const std::string& name) const { return values_.at(name); }
  [[nodiscard]] bool empty() const { return values_.empty(); }
  /// "PREFIX_NAME" <= bound for the median and, from three seeds on, "PREFIX_NAME_worst" <= 2 bound.
  void check(const std::string& prefix, const std::string& name, double bound, std::vector<Check>& checks) const;
  /// "name median (worst), ..." in percent.
  [[nodiscard]] std::string text() const;

 private:
  std::map<std::string, std::vector<double>> values_;
};

/// A method and a sight rule that a precut experiment runs.
struct PrecutMethod {
  solvers::Method method;
  solvers::SightRule sight;
  bool judged; // held to the bounds; else its error is reported
  [[nodiscard]] solvers::DiscretisationOptions options() const;
  [[nodiscard]] std::string name() const; // "galerkin_enriched"
  /// The tight bound for the default method, the loose one for the other.
  [[nodiscard]] double bound(double tight, double loose) const;
};

/// The two methods with the enriched basis, which are judged; in a full run also their other sight rules and
/// `published`, which are reported. `with_appended`: a cut that only appends, too, which is judged.
std::vector<PrecutMethod> precut_methods(bool quick, bool with_appended = false);

/// In a full run both, in a quick one tilted alone. Aligned cuts are run on the finest nodes by the judged methods, and
/// held to the same bounds.
std::vector<Placement> precut_placements(bool quick);
/// "_aligned", or nothing: at the end of what is told of a placement.
std::string suffix(Placement placement);
/// "tilted" or "aligned", as tables have it.
std::string to_string(Placement placement);

/// A method at a placement.
struct PrecutRun {
  PrecutMethod method;
  Placement placement;
  [[nodiscard]] std::string name() const { return method.name() + suffix(placement); }
};
/// Every method at every placement at which it is run.
std::vector<PrecutRun> precut_runs(bool quick, bool with_appended = false);

} // namespace spherecut::experiments
