// Contact queries on surfaces of growing size: the walk after 0.1 mm of motion, FCL's first touch, CGAL's closest
// point. The walk's bound is 5 us on any organ of up to 500k triangles.
#include "tests/support/bumpy_sphere.hpp"
#include "topology/tool/contact.hpp"

#include <benchmark/benchmark.h>
#include <memory>
#include <random>

namespace spherecut::topology {
namespace {

enum Tool { sphere, punch, laparoscope };

/// Liver-sized organ with 12 n^2 triangles; kept for the next benchmark of the same size.
const ContactQuery& organ(int n) {
  static std::map<int, std::unique_ptr<ContactQuery>> kept;
  std::unique_ptr<ContactQuery>& query = kept[n];
  if (!query)
    query = std::make_unique<ContactQuery>(tests::bumpy_sphere(n, 0.08, 0.05));
  return *query;
}

/// Poses of a tool that presses about 3 mm deep and slides by 0.1 mm a step, in any direction over the surface.
std::vector<ToolPose> slide(const ContactQuery& query, const ToolShape& tool, const Vector3& start, int steps) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::vector<ToolPose> poses;
  Vector3 point = query.closest_point(start).point, heading(0.3, 1, 0.2);
  for (int i = 0; i < steps; ++i) {
    const SurfaceContact below = query.closest_point(point);
    heading += 0.1 * Vector3::NullaryExpr([&] { return normal(random); });
    const Vector3 along = heading - heading.dot(below.normal) * below.normal;
    point +=
        1e-4 * (along.normalized() + std::clamp((below.depth - 0.003) / 1e-4, -1.0, 1.0) * below.normal).normalized();
    poses.push_back(pose_at(tool, point, (below.normal + Vector3(0.1, 0.2, 0)).normalized()));
  }
  return poses;
}

ToolShape shape(int tool) {
  if (tool == sphere)
    return SphereTip{0.005};
  if (tool == punch)
    return FlatPunch{0.005, 0.05};
  return Laparoscope{0.004, 0.0025, 0.3, Vector3(0.06, 0.05, 0.22)};
}

void name(benchmark::State& state) {
  const std::array<const char*, 3> names{"sphere", "punch", "laparoscope"};
  const auto n = state.range(0);
  state.SetLabel(std::string(names[state.range(1)]) + ", " + std::to_string(12 * n * n) + " triangles");
}

void contact_walk(benchmark::State& state) {
  const ContactQuery& query = organ(static_cast<int>(state.range(0)));
  const ToolShape tool = shape(static_cast<int>(state.range(1)));
  const std::vector<ToolPose> poses = slide(query, tool, {0.02, 0.03, 0.1}, 2000);
  SurfaceContact last = query.first_touch(tool, poses.front());
  std::size_t i = 0;
  int direction = 1; // to the end of the slide and back
  for (auto _ : state) {
    last = query.walk(tool, poses[i], last);
    benchmark::DoNotOptimize(last);
    if (i + direction >= poses.size())
      direction = -direction;
    i += direction;
  }
  name(state);
}

void contact_first_touch(benchmark::State& state) {
  const ContactQuery& query = organ(static_cast<int>(state.range(0)));
  const ToolShape tool = shape(static_cast<int>(state.range(1)));
  const std::vector<ToolPose> poses = slide(query, tool, {0.02, 0.03, 0.1}, 200);
  std::size_t i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(query.first_touch(tool, poses[i++ % poses.size()]));
  name(state);
}

void contact_closest_point(benchmark::State& state) {
  const ContactQuery& query = organ(static_cast<int>(state.range(0)));
  const std::vector<ToolPose> poses = slide(query, SphereTip{0.005}, {0.02, 0.03, 0.1}, 2000);
  std::size_t i = 0;
  for (auto _ : state) {
    const ToolPose& pose = poses[i++ % poses.size()];
    benchmark::DoNotOptimize(query.closest_point(pose.point + 0.005 * pose.axis));
  }
  state.SetLabel(std::to_string(12 * state.range(0) * state.range(0)) + " triangles");
}

// 12 n^2: 4.8k, 48k, 499k triangles.
BENCHMARK(contact_walk)
    ->ArgsProduct({{20, 63, 204}, {sphere, punch, laparoscope}})
    ->Repetitions(9)
    ->ReportAggregatesOnly()
    ->MinTime(0.05);
BENCHMARK(contact_first_touch)
    ->ArgsProduct({{20, 63, 204}, {sphere, punch, laparoscope}})
    ->Unit(benchmark::kMicrosecond)
    ->Repetitions(5)
    ->ReportAggregatesOnly()
    ->MinTime(0.05);
BENCHMARK(contact_closest_point)->ArgsProduct({{20, 63, 204}})->Repetitions(9)->ReportAggregatesOnly()->MinTime(0.05);

} // namespace
} // namespace spherecut::topology
