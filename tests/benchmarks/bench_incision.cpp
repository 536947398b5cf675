// Queries of a cut of growing size, and what an increment of 2 mm of a blade costs. A sight line of up to 6 mm near 10k
// triangles has a bound of 150 ns, an update of the level sets with voxels of 1 mm one of 0.7 ms.
#include "topology/blade/blade.hpp"
#include "topology/incision/cut_fields.hpp"

#include <benchmark/benchmark.h>
#include <cmath>
#include <ctime>
#include <map>
#include <random>

namespace spherecut::topology {
namespace {

/// A wavy cut 100 mm long and 60 mm deep in a block.
Vector3 on_cut(double s, double t) {
  return {0.1 * s, 0.008 * std::sin(5 * s) + 0.002 * t, -0.06 * t};
}

SurfaceMesh wavy_cut(int triangles) {
  const int n = static_cast<int>(std::sqrt(triangles / 2.0)), m = triangles / 2 / n;
  SurfaceMesh mesh;
  for (int j = 0; j <= m; ++j)
    for (int i = 0; i <= n; ++i)
      mesh.vertices.push_back(on_cut(double(i) / n, double(j) / m));
  for (int j = 0; j < m; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = b + n + 1, d = a + n + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

std::shared_ptr<const Domain> block() {
  static const auto domain = make_box_domain(Vector3(-0.02, -0.06, -0.1), Vector3(0.12, 0.06, 0), 0.02);
  return domain;
}

const Incision& incision(int triangles) {
  static std::map<int, std::unique_ptr<Incision>> kept;
  std::unique_ptr<Incision>& cut = kept[triangles];
  if (!cut)
    cut = std::make_unique<Incision>(std::vector{wavy_cut(triangles)}, block());
  return *cut;
}

/// Segments of up to 6 mm that start within a few millimetres of the cut, as the supports of a node see it.
const std::vector<std::array<Vector3, 2>>& sight_lines() {
  static const auto lines = [] {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> normal;
    const auto direction = [&] { return Vector3::NullaryExpr([&] { return normal(random); }).eval(); };
    std::vector<std::array<Vector3, 2>> result;
    for (int i = 0; i < 1 << 16; ++i) {
      const double s = uniform(random), t = uniform(random);
      const Vector3 start = on_cut(s, t) + 0.005 * direction();
      const Vector3 towards = direction().normalized();
      result.push_back({start, start + 0.006 * uniform(random) * towards});
    }
    return result;
  }();
  return lines;
}

template <class Query>
void run(benchmark::State& state, const Query& query) {
  const Incision& cut = incision(static_cast<int>(state.range(0)));
  const auto& lines = sight_lines();
  std::size_t i = 0;
  std::int64_t found = 0;
  for (auto _ : state) {
    found += query(cut, lines[i][0], lines[i][1]) ? 1 : 0;
    i = (i + 1) % lines.size();
  }
  benchmark::DoNotOptimize(found);
  state.counters["found"] = benchmark::Counter(static_cast<double>(found), benchmark::Counter::kAvgIterations);
}

void sight_line(benchmark::State& state) {
  run(state, [](const Incision& cut, const Vector3& x, const Vector3& y) { return cut.blocks(x, y); });
}
void near_sheet(benchmark::State& state) {
  run(state, [](const Incision& cut, const Vector3& x, const Vector3&) { return cut.near(x, 0.003); });
}
void nearest_point(benchmark::State& state) {
  run(state, [](const Incision& cut, const Vector3& x, const Vector3&) { return cut.closest(x, 0.01).has_value(); });
}
void frame_of_front(benchmark::State& state) {
  run(state,
      [](const Incision& cut, const Vector3& x, const Vector3&) { return cut.front_frame(x, 0.02).has_value(); });
}
void shortest_detour(benchmark::State& state) {
  run(state,
      [](const Incision& cut, const Vector3& x, const Vector3& y) { return cut.detour(x, y, 0.01).has_value(); });
}
BENCHMARK(sight_line)->Arg(100)->Arg(1000)->Arg(10000)->Arg(100000);
BENCHMARK(near_sheet)->Arg(10000);
BENCHMARK(nearest_point)->Arg(10000);
BENCHMARK(frame_of_front)->Arg(10000);
BENCHMARK(shortest_detour)->Arg(10000);

void build_incision(benchmark::State& state) {
  const SurfaceMesh sheet = wavy_cut(static_cast<int>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(Incision({sheet}, block()));
}
BENCHMARK(build_incision)->Arg(1000)->Arg(10000)->Unit(benchmark::kMillisecond);

/// An edge 70 mm long that hangs 60 mm deep into the block, on its way along the wavy cut.
struct Slice {
  BladeSweep sweep{{{Vector3(0, 0, 0.01), Vector3(0, 0, -0.06)}, 1e-4}, block()};
  int increments = 0;

  SweepResult advance() {
    BladePose pose;
    pose.time = increments;
    pose.position = on_cut(0.02 * increments++, 0);
    return sweep.move_to(pose);
  }
};
constexpr int slice_increments = 50;

void sweep_increment(benchmark::State& state) {
  auto slice = std::make_unique<Slice>();
  slice->advance();
  for (auto _ : state) {
    benchmark::DoNotOptimize(slice->advance());
    if (slice->increments > slice_increments) {
      state.PauseTiming();
      slice = std::make_unique<Slice>();
      slice->advance();
      state.ResumeTiming();
    }
  }
}
BENCHMARK(sweep_increment)->Unit(benchmark::kMillisecond);

void level_set_increment(benchmark::State& state) {
  std::vector<std::shared_ptr<const Incision>> stages;
  Slice slice;
  slice.advance();
  while (slice.increments <= slice_increments) {
    slice.advance();
    stages.push_back(slice.sweep.incision());
  }
  auto fields = std::make_unique<CutFields>(0.001);
  std::size_t next = 0;
  for (auto _ : state) {
    const std::clock_t start = std::clock(); // processor time: this is one thread, on a machine that may be shared
    fields->update(stages[next]);
    state.SetIterationTime(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    if (++next == stages.size()) {
      next = 0;
      fields = std::make_unique<CutFields>(0.001);
    }
  }
}
BENCHMARK(level_set_increment)->Unit(benchmark::kMillisecond)->UseManualTime();

} // namespace
} // namespace spherecut::topology
