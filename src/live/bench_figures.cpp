#include "src/live/bench_figures.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::app {
namespace {

constexpr double in_contact = 0.05;                     // of the peak
constexpr double mean_over = 0.1, tap_mean_over = 0.02; // s, about which a force oscillates
constexpr double cubic_over = 0.05;                     // s, of readings to one cubic
constexpr double risen_from = 0.1, risen_to = 0.9;      // of the settled force, between which it rises

using Magnitudes = std::vector<double>;

// Ticks from the start at which a force first comes to a level, between two of them by the line.
std::optional<double> reached(const Magnitudes& force, double level) {
  const auto at = std::find_if(force.begin(), force.end(), [&](double f) { return f >= level; });
  if (at == force.end())
    return std::nullopt;
  const auto i = static_cast<double>(at - force.begin());
  return at == force.begin() ? 0 : i - (*at - level) / (*at - *(at - 1));
}

// RMS of a force about its mean over as many ticks to either side, where all of these are there.
std::optional<double> oscillation_of(const Magnitudes& force, std::size_t from, std::size_t to, std::size_t half) {
  Magnitudes sums(force.size() + 1, 0);
  std::partial_sum(force.begin(), force.end(), sums.begin() + 1);
  double squares = 0;
  std::size_t count = 0;
  for (std::size_t i = std::max(from, half); i <= to && i + half < force.size(); ++i, ++count) {
    const double mean = (sums[i + half + 1] - sums[i - half]) / static_cast<double>(2 * half + 1);
    squares += (force[i] - mean) * (force[i] - mean);
  }
  return count > 0 ? std::optional(std::sqrt(squares / static_cast<double>(count))) : std::nullopt;
}

// By the third orthogonal polynomial over the ticks: with leading coefficient 1 its share is a sixth of the derivative.
std::optional<double> jerk_of(const BenchSeries& series, std::size_t from, std::size_t to) {
  const auto half = static_cast<std::size_t>(std::max(2.0, std::round(cubic_over * series.rate / 2)));
  const auto m = static_cast<double>(half);
  const auto polynomial = [m](double i) { return i * i * i - i * (3 * m * m + 3 * m - 1) / 5; };
  double norm = 0;
  for (double i = -m; i <= m; ++i)
    norm += polynomial(i) * polynomial(i);
  double squares = 0;
  std::size_t count = 0;
  for (std::size_t at = std::max(from, half); at <= to && at + half < series.positions.size(); ++at, ++count) {
    Vector3 share = Vector3::Zero();
    for (std::size_t k = 0; k <= 2 * half; ++k)
      share += polynomial(static_cast<double>(k) - m) * (series.positions[at - half + k] - series.positions[at]);
    squares += (6 / norm * share).squaredNorm();
  }
  if (count == 0)
    return std::nullopt;
  return std::sqrt(squares / static_cast<double>(count)) * std::pow(series.rate, 3);
}

double injected_by(const BenchSeries& series) {
  double put_in = 0;
  double most = 0;
  for (std::size_t k = 1 + static_cast<std::size_t>(series.delay); k < series.positions.size(); ++k) {
    const Vector3& acts = series.forces[k - 1 - static_cast<std::size_t>(series.delay)];
    put_in -= acts.dot(series.positions[k] - series.positions[k - 1]);
    most = std::max(most, -put_in);
  }
  return most;
}

} // namespace

BenchFigures bench_figures(const BenchSeries& series, bool holds) {
  if (series.positions.size() != series.forces.size() || !(series.rate > 0) || series.delay < 0)
    throw InputError(fmt::format("{} positions, {} forces, {:g} ticks a second, {} ticks late; allowed: as many of "
                                 "both, a rate above 0, a delay of 0 or more",
                                 series.positions.size(), series.forces.size(), series.rate, series.delay));
  BenchFigures figures;
  Magnitudes force;
  force.reserve(series.forces.size());
  for (const Vector3& f : series.forces)
    force.push_back(f.norm());
  figures.injected = injected_by(series);
  figures.peak = force.empty() ? 0 : *std::max_element(force.begin(), force.end());
  if (!(figures.peak > 0))
    return figures;
  const auto touches = [&](double f) { return f >= in_contact * figures.peak; };
  const auto first = static_cast<std::size_t>(std::find_if(force.begin(), force.end(), touches) - force.begin());
  const auto last =
      force.size() - 1 - static_cast<std::size_t>(std::find_if(force.rbegin(), force.rend(), touches) - force.rbegin());
  const std::size_t steady = holds ? last - (last - first) / 3 : first;
  double reference = figures.peak;
  const auto at = [&](std::size_t i) { return force.begin() + static_cast<std::ptrdiff_t>(i); };
  if (holds) {
    reference = std::accumulate(at(steady), at(last + 1), 0.0) / static_cast<double>(last + 1 - steady);
    figures.settled = reference;
    figures.overshoot = std::max(0.0, *std::max_element(at(first), at(steady + 1)) / reference - 1);
  }
  const std::optional<double> begun = reached(force, risen_from * reference);
  const std::optional<double> risen = reached(force, risen_to * reference);
  if (begun && risen)
    figures.rise = (*risen - *begun) / series.rate;
  const double mean = holds ? mean_over : tap_mean_over;
  const auto half = static_cast<std::size_t>(std::max(1.0, std::round(mean * series.rate / 2)));
  figures.oscillation = oscillation_of(force, steady, last, half);
  figures.jerk = jerk_of(series, first, last);
  return figures;
}

} // namespace spherecut::app
