// The wound's surface per 2 mm increment of a growing cut, and cut at once, on livers of growing size. The bar is 2 ms
// an increment at 20k triangles, and a growth with the organ's size of at most 1.3 times at a fixed count crossed.
#include "topology/organ/organs.hpp"
#include "topology/wound/wound.hpp"

#include <algorithm>
#include <benchmark/benchmark.h>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

namespace spherecut::topology {
namespace {

const SurfaceMesh& liver(int triangles) {
  static std::map<int, SurfaceMesh> kept;
  SurfaceMesh& organ = kept[triangles];
  if (organ.triangles.empty())
    organ = make_liver(triangles);
  return organ;
}

constexpr int columns = 40, rows = 12;

/// A blade of rows triangles' height that travels in a wave along x, `step` m a column, through the right lobe from
/// above, half way down: partial, so that the organ stays one piece. Columns appended one after another.
SurfaceMesh path(double step, int count) {
  SurfaceMesh sheet;
  for (int i = 0; i <= count; ++i)
    for (int j = 0; j <= rows; ++j) {
      const double x = -0.083 + step * i, depth = double(j) / rows;
      sheet.vertices.emplace_back(x, 0.0131 + 0.005 * std::sin(60 * x) + 0.001 * depth, 0.09 - 0.1 * depth + 0.0003);
    }
  const auto at = [](int i, int j) { return i * (rows + 1) + j; };
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < rows; ++j) {
      sheet.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      sheet.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return sheet;
}

/// range(0): triangles of the organ; range(1): step in micrometres.
void wound_increment(benchmark::State& state) {
  const SurfaceMesh& organ = liver(static_cast<int>(state.range(0)));
  std::vector<std::vector<SurfaceMesh>> stages;
  for (int c = 1; c <= columns; ++c)
    stages.push_back({path(1e-6 * static_cast<double>(state.range(1)), c)});
  std::unique_ptr<IncrementalWound> wound;
  int stage = columns;
  double crossed = 0, rebuilt = 0;
  for (auto _ : state) {
    if (stage == columns) {
      state.PauseTiming();
      wound = std::make_unique<IncrementalWound>(organ);
      stage = 0;
      state.ResumeTiming();
    }
    const IncrementalWound::Growth growth = wound->grow(stages[stage++]);
    crossed += growth.crossed;
    rebuilt += growth.rebuilt;
  }
  const auto count = static_cast<double>(state.iterations());
  state.counters["crossed"] = crossed / count;
  state.counters["rebuilt"] = rebuilt / count;
  state.counters["organ"] = static_cast<double>(organ.triangles.size());
}

void wound_at_once(benchmark::State& state) {
  const SurfaceMesh& organ = liver(static_cast<int>(state.range(0)));
  const std::vector<SurfaceMesh> sheets = {path(0.002, columns)};
  for (auto _ : state)
    benchmark::DoNotOptimize(cut_surface(organ, sheets));
}

BENCHMARK(wound_increment)
    ->ArgsProduct({{5000, 20000, 80000}, {2000}})
    ->Args({5000, 3000}) // steps in proportion to the edges: the same count crossed
    ->Args({20000, 1500})
    ->Args({80000, 750})
    ->Unit(benchmark::kMicrosecond)
    ->Iterations(2 * columns)
    ->Repetitions(5)
    ->ReportAggregatesOnly();
BENCHMARK(wound_at_once)->Arg(5000)->Arg(20000)->Arg(80000)->Unit(benchmark::kMillisecond)->Iterations(3);

} // namespace
} // namespace spherecut::topology
