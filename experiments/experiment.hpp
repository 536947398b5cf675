// What every experiment shares: a registry, tables, and checks with a bound.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace spherecut::experiments {

/// One claim: value relation bound, e.g. {"punch_force", 0.012, "<=", 0.02}. Passes when the relation holds.
struct Check {
  std::string name;
  double value = 0;
  std::string relation; // "<=" or ">="
  double bound = 0;
  [[nodiscard]] bool pass() const;
};

struct ExperimentContext {
  std::filesystem::path out; // folder for tables, figures and summary.json; exists
  bool quick = false;        // smaller variant, run by the test suite; same code, fewer sizes and seeds
  std::function<void(const std::string&)> say = [](const std::string&) {}; // progress lines
};

struct Experiment {
  std::string name;
  std::string purpose; // one line
  std::function<std::vector<Check>(const ExperimentContext&)> run;
};

/// All experiments, in the order of the documentation.
const std::vector<Experiment>& all_experiments();

/// Runs one experiment, writes summary.json ({"experiment", "quick", "checks": [{"name", "value", "relation", "bound",
/// "pass"}]}) and returns its checks. Throws InputError for an unknown name or an unusable folder.
std::vector<Check> run_experiment(const std::string& name, const std::filesystem::path& out, bool quick,
                                  const std::function<void(const std::string&)>& say);

} // namespace spherecut::experiments
