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

solvers::DiscretisationOptions PrecutMethod::options() const {
  solvers::DiscretisationOptions options;
  options.method = method;
  options.sight = sight;
  return options;
}

std::string PrecutMethod::name() const {
  return fmt::format("{}_{}", solvers::to_string(method), solvers::to_string(sight));
}

double PrecutMethod::bound(double tight, double loose) const {
  return method == solvers::DiscretisationOptions{}.method ? tight : loose;
}

std::vector<PrecutMethod> precut_methods(bool quick, bool with_appended) {
  using solvers::Method, solvers::SightRule;
  std::vector<PrecutMethod> methods{{Method::galerkin, SightRule::enriched, true},
                                    {Method::collocation, SightRule::enriched, true}};
  if (with_appended)
    methods.push_back({Method::galerkin, SightRule::appended, true});
  if (!quick)
    for (const SightRule rule : {SightRule::diffraction, SightRule::visibility})
      for (const Method method : {Method::galerkin, Method::collocation})
        methods.push_back({method, rule, false});
  if (!quick)
    methods.push_back({Method::published, SightRule::visibility, false});
  return methods;
}

std::vector<Placement> precut_placements(bool quick) {
  return quick ? std::vector{Placement::tilted} : std::vector{Placement::tilted, Placement::aligned};
}

std::string suffix(Placement placement) {
  return placement == Placement::aligned ? "_aligned" : "";
}

std::string to_string(Placement placement) {
  return placement == Placement::aligned ? "aligned" : "tilted";
}

std::vector<PrecutRun> precut_runs(bool quick, bool with_appended) {
  std::vector<PrecutRun> runs;
  for (const Placement placement : precut_placements(quick))
    for (const PrecutMethod& method : precut_methods(quick, with_appended))
      if (method.judged || placement == Placement::tilted)
        runs.push_back({method, placement});
  return runs;
}

} // namespace spherecut::experiments
