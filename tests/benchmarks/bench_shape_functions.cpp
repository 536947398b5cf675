// Moving least squares value and gradient at a point with 19 supporting nodes: kernels, search, and the whole call.
#include "solvers/shapes/functions.hpp"
#include "solvers/shapes/kernel.hpp"

#include <benchmark/benchmark.h>
#include <cmath>
#include <random>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

double uniform(std::mt19937_64& random) {
  return std::ldexp(static_cast<double>(random() >> 11), -53);
}

// A jittered lattice and the points in it that have exactly 19 supporting nodes.
struct Scene {
  static constexpr int neighbours = 19;
  Spheres spheres;
  std::vector<Vector3> points;

  static Spheres make(Basis basis) {
    std::mt19937_64 random(1);
    std::vector<Vector3> centres;
    for (int i = 0; i < 14; ++i)
      for (int j = 0; j < 14; ++j)
        for (int k = 0; k < 14; ++k) {
          const double x = uniform(random), y = uniform(random), z = uniform(random);
          centres.emplace_back(0.01 * (Vector3(i, j, k) + 0.4 * Vector3(x - 0.5, y - 0.5, z - 0.5)));
        }
    const std::vector<double> spacings(centres.size(), 0.01);
    return Spheres(std::move(centres), spacings, basis == Basis::linear ? 1.65 : 2.2, basis);
  }

  explicit Scene(Basis basis) : spheres(make(basis)) {
    std::mt19937_64 random(2);
    ShapeFunctions shape;
    while (points.size() < 1024) {
      const double x = uniform(random), y = uniform(random), z = uniform(random);
      const Vector3 p = 0.02 * Vector3::Ones() + 0.09 * Vector3(x, y, z);
      if (evaluate(spheres, p, shape) && (basis == Basis::quadratic || shape.size() == neighbours))
        points.push_back(p);
    }
  }
};

const Scene& scene() {
  static const Scene linear(Basis::linear);
  return linear;
}

const shape_kernel::Kernel* kernel_of(int index) {
  using namespace shape_kernel;
  const Kernel* all[] = {&portable(), avx2(), avx512()};
  const Kernel* kernel = all[index];
  return kernel != nullptr && kernel->width <= dispatched().width ? kernel : nullptr;
}

// The whole call: search, support, value and gradient, into an object that keeps its memory.
void shape_evaluate(benchmark::State& state) {
  const shape_kernel::Kernel* kernel = kernel_of(static_cast<int>(state.range(0)));
  if (kernel == nullptr) {
    state.SkipWithError("not on this machine");
    return;
  }
  state.SetLabel(kernel->name);
  ShapeFunctions shape;
  std::size_t i = 0;
  for (auto _ : state) {
    shape_kernel::evaluate_with(*kernel, scene().spheres, scene().points[i++ % 1024], shape);
    benchmark::DoNotOptimize(shape.dx.data());
  }
}
BENCHMARK(shape_evaluate)->DenseRange(0, 2);

// Search and support alone.
void shape_collect(benchmark::State& state) {
  const shape_kernel::Kernel* kernel = kernel_of(static_cast<int>(state.range(0)));
  if (kernel == nullptr) {
    state.SkipWithError("not on this machine");
    return;
  }
  state.SetLabel(kernel->name);
  std::vector<double> memory(4 * 256);
  std::vector<int> ids(256);
  shape_kernel::Support support{
      0, ids.data(), memory.data(), memory.data() + 256, memory.data() + 512, memory.data() + 768};
  std::size_t i = 0;
  double candidates = 0;
  for (auto _ : state) {
    const Vector3& x = scene().points[i++ % 1024];
    const SphereGrid::Cell cell = scene().spheres.grid().find(x);
    candidates += static_cast<double>(cell.ids.size());
    kernel->collect(cell, x.data(), support);
    benchmark::DoNotOptimize(support.count);
  }
  state.counters["candidates"] = candidates / static_cast<double>(state.iterations());
}
BENCHMARK(shape_collect)->DenseRange(0, 2);

void shape_candidates(benchmark::State& state) {
  std::size_t i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(scene().spheres.candidates(scene().points[i++ % 1024]).data());
}
BENCHMARK(shape_candidates);

void shape_second_derivatives(benchmark::State& state) {
  ShapeFunctions shape;
  std::size_t i = 0;
  for (auto _ : state) {
    evaluate_second(scene().spheres, scene().points[i++ % 1024], shape);
    benchmark::DoNotOptimize(shape.dxx.data());
  }
}
BENCHMARK(shape_second_derivatives);

void shape_quadratic(benchmark::State& state) {
  static const Scene quadratic(Basis::quadratic);
  ShapeFunctions shape;
  std::size_t i = 0;
  for (auto _ : state) {
    evaluate(quadratic.spheres, quadratic.points[i++ % 1024], shape);
    benchmark::DoNotOptimize(shape.dx.data());
  }
  state.counters["neighbours"] = shape.size();
}
BENCHMARK(shape_quadratic);

// Spheres of a cloud of 2744 nodes: radii, growth test at every node, search grid.
void shape_build_spheres(benchmark::State& state) {
  for (auto _ : state)
    benchmark::DoNotOptimize(Scene::make(Basis::linear).size());
}
BENCHMARK(shape_build_spheres)->Unit(benchmark::kMicrosecond);

} // namespace
