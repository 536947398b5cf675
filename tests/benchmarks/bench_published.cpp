// The paper's real-time step with 34 nodes, and its parts. 5000 steps a second is 200 us a step; the paper had 100 a
// second.
#include "solvers/algebra/dense_elimination.hpp"
#include "solvers/published/step.hpp"
#include "tests/support/tip_pattern.hpp"

#include <benchmark/benchmark.h>
#include <cmath>
#include <stdexcept>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

// Place the pattern at a moving contact, then supports, rows, condensation, force.
void published_step(benchmark::State& state) {
  const tests::TipPattern pattern = tests::tip_pattern(0.005);
  NodeCloud placed = pattern.nodes;
  PublishedStep published(placed.size(), {8000, 0.3, 1000});
  double angle = 0;
  Vector3 force = Vector3::Zero();
  for (auto _ : state) {
    angle += 1e-3;
    const Vector3 normal = Vector3(0.3 * std::cos(angle), 0.3 * std::sin(angle), 1).normalized();
    tests::place(pattern, 0.1 * normal, normal, placed);
    const PublishedStepResult result = published.step(placed, pattern.held, 0, -0.002 * normal);
    if (result.status != StepStatus::solved)
      throw std::runtime_error("the step was not solved");
    force = result.force;
    benchmark::DoNotOptimize(force);
  }
  state.counters["nodes"] = placed.size();
  state.counters["steps_per_second"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(published_step)->Unit(benchmark::kMicrosecond);

// The elimination alone: 99 unknowns and three right-hand sides, dispatched (0) and portable (1).
void published_elimination(benchmark::State& state) {
  constexpr int n = 99;
  DenseSystem system(n, 3);
  for (auto _ : state) {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n + 3; ++j)
        system.row(i)[j] = 1 / (1.0 + std::abs(i - j)) + (i == j ? 1 : 0);
    benchmark::DoNotOptimize(state.range(0) == 0 ? system.solve() : system.solve_portable());
  }
}
BENCHMARK(published_elimination)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

} // namespace
