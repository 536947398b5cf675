// Runs of back ends over one scenario, and what is made of them: error-cost curves, equal-error ratios, tables.
#pragma once

#include "experiments/experiment.hpp"
#include "experiments/remeshing_ledger/back_end.hpp"

#include <vector>

namespace spherecut::experiments::ledger {

using MakeBackEnd = std::function<std::unique_ptr<BackEnd>(const Scenario&, const Resolution&)>;

/// One back end with the sizes its error-cost curve is walked with.
struct Contender {
  std::string name;
  bool ours = false;
  MakeBackEnd make;
  std::vector<double> sizes; // m, at the front, coarse to fine
};

/// One back end at one size, once through the increments.
struct Run {
  std::string scenario, name;
  bool ours = false;
  double fine = 0; // m
  int repeat = 0;
  std::vector<Increment> increments; // the first is the start, which is not counted
  Opening opening;
  double error = Increment::unknown; // of the opening, relative
  double force_error = Increment::unknown;
  double condition = Increment::unknown;
  double peak_memory = 0; // bytes, beyond what was held at the start
  [[nodiscard]] int failures() const;
  [[nodiscard]] double smallest_quality() const;
  /// Medians over the counted increments, s. Where every few increments something is made anew the mean says more.
  [[nodiscard]] double median_processor() const;
  [[nodiscard]] double mean_processor() const;
  [[nodiscard]] double mean_wall() const;
  [[nodiscard]] double mean_stage(int stage) const;
};

/// What the last increment is judged by.
struct Reference {
  double volume = Increment::unknown, marked = Increment::unknown, force = Increment::unknown;
};

/// `wanted`: numbers of the increments, ascending, the first the start; those who cannot skip go through all between.
Run run_once(const Scenario& scenario, const Contender& contender, double fine, const Reference& reference,
             const std::vector<int>& wanted, int repeat, bool with_condition);

/// Interleaved: every repeat goes through all contenders and sizes before the next begins.
std::vector<Run> run_all(const Scenario& scenario, const std::vector<Contender>& contenders, const Reference& reference,
                         const std::vector<int>& wanted, int repeats, const ExperimentContext& context);

/// Cost at an error, s: on the line through the logarithms of the two best runs on either side of it, where the cost is
/// that of the cheapest run with that error or less. NaN where the error is not reached; where every run is better the
/// cheapest one's, which is more than it would take.
double cost_at(const std::vector<Run>& runs, const std::string& name, int repeat, double error);

/// Ratios of every contender to the cheapest of ours at equal error.
struct Ratio {
  std::string scenario, name;
  double error = 0;
  double cost = 0;                           // s, median over repeats
  double ratio = 0, lowest = 0, highest = 0; // median over repeats and range
  bool ours = false;
  std::string against; // the one of ours
  bool finer = false;  // its coarsest run is better than asked: the cost is an upper bound
};
/// Strongest first.
std::vector<Ratio> ratios_at(const std::vector<Run>& runs, double error);

void write_tables(const std::vector<Run>& runs, const std::vector<Ratio>& ratios, const ExperimentContext& context);

} // namespace spherecut::experiments::ledger
