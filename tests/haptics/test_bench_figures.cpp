// The figures of `spherecut haptics --bench` against responses that are known in closed form.
#include "src/live/bench_figures.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;

namespace {

using Course = std::function<double(double)>; // of time, s

/// Readings along z and forces along x, so that neither does work on the other.
BenchSeries series_of(const Course& position, const Course& force, double seconds, double rate = 1000) {
  BenchSeries series;
  series.rate = rate;
  for (int k = 0; k < seconds * rate; ++k) {
    series.positions.push_back({0, 0, position(k / rate)});
    series.forces.push_back({force(k / rate), 0, 0});
  }
  return series;
}

const Course still = [](double) { return 0.0; };

/// Answer of a damped oscillator to a step at 0.2 s, settling at `settled`.
Course step_response(double omega, double damping, double settled) {
  return [=](double time) {
    const double t = time - 0.2;
    const double root = std::sqrt(1 - damping * damping);
    return t <= 0 ? 0
                  : settled * (1 - std::exp(-damping * omega * t) *
                                       (std::cos(omega * root * t) + damping / root * std::sin(omega * root * t)));
  };
}

double first_time(const Course& course, double level) {
  double from = 0.2;
  double to = 0.2;
  while (course(to) < level)
    to += 1e-4;
  from = to - 1e-4;
  for (int i = 0; i < 50; ++i) {
    const double middle = (from + to) / 2;
    (course(middle) < level ? from : to) = middle;
  }
  return to;
}

/// A wall of 400 N/m under a hand that goes in by 5 mm and out again, twice a second; force by readings a share of a
/// tick on from the tick's own.
BenchSeries spring(double ahead) {
  BenchSeries series;
  const auto depth = [](double k) { return 0.005 * std::pow(std::sin(2 * std::numbers::pi * k / 1000), 2); };
  for (int k = 0; k <= 2000; ++k) {
    series.positions.push_back({0, 0, -depth(k)});
    series.forces.push_back({0, 0, 400 * ((1 - ahead) * depth(k) + ahead * depth(k + 1))});
  }
  return series;
}

} // namespace

TEST_CASE("Rise time and overshoot are those of an oscillator of second order") {
  for (const double damping : {0.2, 0.5, 0.7}) {
    const double omega = 60;
    const Course force = step_response(omega, damping, 0.8);
    const BenchFigures figures = bench_figures(series_of(still, force, 2.2), true);
    const double overshoot = std::exp(-damping * std::numbers::pi / std::sqrt(1 - damping * damping));
    CHECK(figures.settled.value() == Approx(0.8).epsilon(1e-4));
    CHECK(figures.overshoot.value() == Approx(overshoot).epsilon(0.005));
    CHECK(figures.rise.value() == Approx(first_time(force, 0.72) - first_time(force, 0.08)).margin(2e-5));
    CHECK(figures.peak == Approx(0.8 * (1 + overshoot)).epsilon(0.002));
    CHECK(figures.oscillation.value() < 1e-4);
    CHECK(figures.injected == 0);
  }
  const Course slow = [](double t) {
    return 1 - std::exp(-t / 0.05);
  }; // of first order: ln 9 time constants, no overshoot
  const BenchFigures figures = bench_figures(series_of(still, slow, 2), true);
  CHECK(figures.rise.value() == Approx(0.05 * std::log(9)).epsilon(1e-3));
  CHECK(figures.overshoot.value() < 1e-9);
}

TEST_CASE("Oscillation is the root mean square of what is faster than the mean, and of that alone") {
  const auto wave = [](double hertz) {
    return [hertz](double t) { return 1 + 0.1 * std::sin(2 * std::numbers::pi * hertz * t); };
  };
  for (const double hertz : {20.0, 60.0, 200.0}) // whole periods in a mean: nothing of them is in it
    CHECK(bench_figures(series_of(still, wave(hertz), 3), true).oscillation.value() ==
          Approx(0.1 / std::sqrt(2)).epsilon(0.02));
  CHECK(bench_figures(series_of(still, wave(0.5), 6), true).oscillation.value() < 0.001);
  CHECK(bench_figures(series_of(
                          still, [](double t) { return 1 + t; }, 3),
                      true)
            .oscillation.value() < 1e-9);
}

TEST_CASE("A passive spring injects no energy, and one that is held from tick to tick what its steps are worth") {
  CHECK(bench_figures(spring(0.5), true).injected == Approx(0).margin(1e-12));
  const BenchSeries held = spring(0);
  double worth = 0; // k dx^2 / 2 a tick
  for (std::size_t k = 1; k < held.positions.size(); ++k)
    worth += 200 * (held.positions[k] - held.positions[k - 1]).squaredNorm();
  CHECK(worth > 1e-5);
  CHECK(bench_figures(held, true).injected == Approx(worth).epsilon(0.01));
  BenchSeries late = held;
  late.delay = 3; // 3 dx k dx more a tick: seven times as much
  CHECK(bench_figures(late, true).injected == Approx(7 * worth).epsilon(0.05));
}

TEST_CASE("Jerk is the third derivative of the readings") {
  const auto touched = [](double) { return 1.0; };
  const Course cubic = [](double t) { return 0.01 + 0.2 * t - t * t + 3 * t * t * t; };
  CHECK(bench_figures(series_of(cubic, touched, 1), true).jerk.value() == Approx(18).epsilon(1e-6));
  const double omega = 20;
  const Course sway = [=](double t) { return 0.01 * std::sin(omega * t); };
  CHECK(bench_figures(series_of(sway, touched, 10 * std::numbers::pi / omega, 2000), true).jerk.value() ==
        Approx(0.01 * omega * omega * omega / std::sqrt(2)).epsilon(0.03));
}

TEST_CASE("A tap has no settled force, and a manoeuvre that touched nothing has no figures") {
  const Course tap = [](double t) { return t < 0.3 || t > 0.5 ? 0 : std::sin(std::numbers::pi * (t - 0.3) / 0.2); };
  const BenchFigures figures = bench_figures(series_of(still, tap, 1), false);
  CHECK_FALSE(figures.settled);
  CHECK_FALSE(figures.overshoot);
  const double rise = (std::asin(0.9) - std::asin(0.1)) * 0.2 / std::numbers::pi;
  CHECK(figures.rise.value() == Approx(rise).epsilon(1e-3));
  const BenchFigures none = bench_figures(series_of(still, still, 1), true);
  CHECK(none.peak == 0);
  CHECK_FALSE(none.settled);
  CHECK_FALSE(none.rise);
  CHECK_FALSE(none.oscillation);
  CHECK_FALSE(none.jerk);
  CHECK_NOTHROW(bench_figures({}, true));
  BenchSeries odd = series_of(still, still, 1);
  odd.forces.pop_back();
  CHECK_THROWS_AS(bench_figures(odd, true), InputError);
}
