#include "experiments/remeshing_ledger/ledger.hpp"

#include "experiments/remeshing_ledger/own_process.hpp"
#include "experiments/support/statistics.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <set>

namespace spherecut::experiments::ledger {

namespace {

template <typename Of>
double mean_of(const std::vector<Increment>& increments, Of&& of) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < increments.size(); ++i)
    if (increments[i].failure.empty()) {
      sum += of(increments[i]);
      ++count;
    }
  return count == 0 ? Increment::unknown : sum / count;
}

double opening_error(const Opening& opening, const Reference& reference) {
  if (std::isfinite(opening.profile_error))
    return opening.profile_error;
  return std::max(std::abs(opening.volume / reference.volume - 1), std::abs(opening.marked / reference.marked - 1));
}

} // namespace

int Run::failures() const {
  return static_cast<int>(
      std::count_if(increments.begin(), increments.end(), [](const Increment& i) { return !i.failure.empty(); }));
}

double Run::smallest_quality() const {
  double least = Increment::unknown;
  for (const Increment& i : increments)
    if (std::isfinite(i.quality) && !(least <= i.quality))
      least = i.quality;
  return least;
}

double Run::median_processor() const {
  std::vector<double> seconds;
  for (std::size_t i = 1; i < increments.size(); ++i)
    if (increments[i].failure.empty())
      seconds.push_back(increments[i].times.total_processor());
  return seconds.empty() ? Increment::unknown : median(seconds);
}

double Run::mean_processor() const {
  return mean_of(increments, [](const Increment& i) { return i.times.total_processor(); });
}

double Run::mean_wall() const {
  return mean_of(increments, [](const Increment& i) { return i.times.total_wall(); });
}

double Run::mean_stage(int stage) const {
  return mean_of(increments,
                 [stage](const Increment& i) { return i.times.processor[static_cast<std::size_t>(stage)]; });
}

Run run_once(const Scenario& scenario, const Contender& contender, double fine, const Reference& reference,
             const std::vector<int>& wanted, int repeat, bool with_condition) {
  Run run;
  run.scenario = scenario.name;
  run.name = contender.name;
  run.ours = contender.ours;
  run.fine = fine;
  run.repeat = repeat;
  reset_peak_memory();
  const double held = memory_held();
  Resolution resolution;
  resolution.fine = fine;
  resolution.first = wanted.front();
  const std::unique_ptr<BackEnd> back_end = contender.make(scenario, resolution);
  double mesher = 0;
  const auto guarded = [&](int number, auto&& step) {
    Increment increment;
    try {
      increment = step();
    } catch (const NumericalError& error) {
      increment.failure = error.what();
    } catch (const InputError& error) {
      increment.failure = error.what();
    }
    increment.number = number;
    mesher = std::max(mesher, increment.mesher_memory);
    run.increments.push_back(increment);
  };
  guarded(wanted.front(), [&] { return back_end->start(); });
  for (std::size_t w = 1; w < wanted.size(); ++w)
    for (int k = back_end->may_skip() ? wanted[w] : wanted[w - 1] + 1; k <= wanted[w]; ++k)
      guarded(k, [&] { return back_end->advance(k); });
  run.peak_memory = std::max(peak_memory() - held, mesher);
  if (!run.increments.back().failure.empty())
    return run;
  run.opening = back_end->opening();
  run.error = opening_error(run.opening, reference);
  run.force_error = std::abs(run.opening.force / reference.force - 1);
  if (with_condition)
    run.condition = back_end->condition();
  return run;
}

std::vector<Run> run_all(const Scenario& scenario, const std::vector<Contender>& contenders, const Reference& reference,
                         const std::vector<int>& wanted, int repeats, const ExperimentContext& context) {
  std::vector<Run> runs;
  for (int repeat = 0; repeat < repeats; ++repeat)
    for (const Contender& contender : contenders)
      for (double fine : contender.sizes) {
        runs.push_back(run_once(scenario, contender, fine, reference, wanted, repeat, repeat == 0));
        const Run& run = runs.back();
        context.say(fmt::format(
            "{} {} h = {:.4g} m, run {}: opening off by {:.2f} %, {:.1f} ms an increment ({:.1f} ms on the wall), {} "
            "unknowns{}",
            run.scenario, run.name, fine, repeat + 1, 100 * run.error, 1e3 * run.mean_processor(),
            1e3 * run.mean_wall(), run.increments.back().unknowns,
            run.failures() > 0 ? fmt::format("; {} failed: {}", run.failures(), run.increments.back().failure) : ""));
      }
  return runs;
}

double cost_at(const std::vector<Run>& runs, const std::string& name, int repeat, double error) {
  // The frontier: no other run is both cheaper and better.
  std::vector<std::pair<double, double>> points; // error, cost
  for (const Run& run : runs)
    if (run.name == name && run.repeat == repeat && std::isfinite(run.error) && run.mean_processor() > 0)
      points.emplace_back(run.error, run.mean_processor());
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<std::pair<double, double>> frontier;
  for (const auto& point : points)
    if (frontier.empty() || point.first < frontier.back().first)
      frontier.push_back(point);
  if (frontier.empty() || frontier.back().first > error)
    return Increment::unknown;
  if (frontier.front().first <= error)
    return frontier.front().second;
  std::size_t i = 1;
  while (frontier[i].first > error)
    ++i;
  const auto& [e0, c0] = frontier[i - 1];
  const auto& [e1, c1] = frontier[i];
  const double share = (std::log(error) - std::log(e0)) / (std::log(e1) - std::log(e0));
  return std::exp(std::log(c0) + share * (std::log(c1) - std::log(c0)));
}

std::vector<Ratio> ratios_at(const std::vector<Run>& runs, double error) {
  std::vector<Ratio> ratios;
  if (runs.empty())
    return ratios;
  int repeats = 0;
  std::vector<std::string> names;
  for (const Run& run : runs) {
    repeats = std::max(repeats, run.repeat + 1);
    if (std::find(names.begin(), names.end(), run.name) == names.end())
      names.push_back(run.name);
  }
  const auto is_ours = [&](const std::string& name) {
    return std::find_if(runs.begin(), runs.end(), [&](const Run& r) { return r.name == name; })->ours;
  };
  const auto median_cost = [&](const std::string& name) {
    std::vector<double> costs;
    for (int repeat = 0; repeat < repeats; ++repeat)
      if (const double cost = cost_at(runs, name, repeat, error); std::isfinite(cost))
        costs.push_back(cost);
    return costs.empty() ? Increment::unknown : median(costs);
  };
  std::string best;
  double least = std::numeric_limits<double>::infinity();
  for (const std::string& name : names)
    if (is_ours(name) && median_cost(name) < least) {
      least = median_cost(name);
      best = name;
    }
  for (const std::string& name : names) {
    Ratio ratio;
    ratio.scenario = runs.front().scenario;
    ratio.name = name;
    ratio.error = error;
    ratio.ours = is_ours(name);
    ratio.against = best;
    ratio.cost = median_cost(name);
    ratio.ratio = ratio.lowest = ratio.highest = Increment::unknown;
    ratio.finer = true;
    for (const Run& run : runs)
      if (run.name == name && run.error > error)
        ratio.finer = false;
    std::vector<double> each;
    for (int repeat = 0; repeat < repeats && !best.empty(); ++repeat)
      if (const double r = cost_at(runs, name, repeat, error) / cost_at(runs, best, repeat, error); std::isfinite(r))
        each.push_back(r);
    if (!each.empty()) {
      ratio.ratio = median(each);
      ratio.lowest = *std::min_element(each.begin(), each.end());
      ratio.highest = largest(each);
    }
    ratios.push_back(ratio);
  }
  std::stable_sort(ratios.begin(), ratios.end(), [](const Ratio& a, const Ratio& b) {
    const double x = std::isfinite(a.cost) ? a.cost : 1e300, y = std::isfinite(b.cost) ? b.cost : 1e300;
    return x < y;
  });
  return ratios;
}

} // namespace spherecut::experiments::ledger
