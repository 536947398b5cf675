// What a point costs in each material law: energy and stress in batches, portable and dispatched kernel; the tangent.
#include "solvers/elasticity/law_checks.hpp"
#include "solvers/elasticity/law_kernel.hpp"

#include <Eigen/LU>
#include <benchmark/benchmark.h>
#include <random>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

LawSpec spec_of(std::int64_t index) {
  const double mu = 3e3, bulk = bulk_modulus_of(mu, 0.49);
  switch (index) {
  case 0:
    return {LinearLaw{mu}, bulk, {}};
  case 1:
    return {NeoHookeanLaw{mu}, bulk, {}};
  case 2:
    return {YeohLaw{0.5 * mu, 0.1 * mu, 0.1 * mu}, bulk, {}};
  case 3:
    return {OgdenLaw{{{0.4 * mu, 2.5}, {-0.2 * mu, -4}, {0.02 * mu, 10}}}, bulk, {}};
  default:
    return {HolzapfelLaw{mu, mu, 1, 0.1, 2, true, {Vector3::UnitX(), Vector3::UnitY()}}, bulk, {}};
  }
}

std::vector<Matrix3> strained(std::size_t count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> part(-0.2, 0.2);
  std::vector<Matrix3> all;
  while (all.size() < count)
    if (const Matrix3 f = Matrix3::Identity() + Matrix3::NullaryExpr([&] { return part(random); });
        f.determinant() > 0.2)
      all.push_back(f);
  return all;
}

// Arguments: index of the law in LawSpec, points, kernel (0 portable, 1 dispatched).
void law_batch(benchmark::State& state) {
  const LawSpec spec = spec_of(state.range(0));
  const auto count = static_cast<std::size_t>(state.range(1));
  const law_kernel::Kernel& kernel = state.range(2) == 0 ? law_kernel::portable() : law_kernel::dispatched();
  const std::vector<Matrix3> gradients = strained(count);
  std::vector<double> energy(count);
  std::vector<Matrix3> stress(count);
  const LawConstants constants = law_constants(spec);
  const FibreFrame frame = law_fibres(spec);
  const law_kernel::Batch batch{.constants = constants.values.data(),
                                .bulk = spec.bulk_modulus,
                                .count = count,
                                .gradients = gradients.front().data(),
                                .frames = frame.direction.front().data(),
                                .frame_stride = 0,
                                .energy = energy.data(),
                                .stress = stress.front().data()};
  for (auto _ : state) {
    kernel.evaluate[spec.law.index()](batch);
    benchmark::ClobberMemory();
  }
  state.SetLabel(std::string(law_name(spec)) + ", " + kernel.name);
  state.counters["seconds_a_point"] = benchmark::Counter(
      static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(law_batch)->ArgsProduct({{0, 1, 2, 3, 4}, {1024, 65536}, {0, 1}})->Unit(benchmark::kMicrosecond);

void law_tangent(benchmark::State& state) {
  const LawSpec spec = spec_of(state.range(0));
  const std::unique_ptr<Law> law = make_law(spec);
  const std::vector<Matrix3> gradients = strained(64);
  const FibreFrame frame = law->own_fibres();
  std::size_t point = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(law->tangent(gradients[++point % gradients.size()], frame));
  state.SetLabel(law->name());
}
BENCHMARK(law_tangent)->DenseRange(0, 4);

// Reading a scenario checks its law once.
void law_check(benchmark::State& state) {
  const LawSpec spec = spec_of(state.range(0));
  for (auto _ : state)
    check_law(spec);
  state.SetLabel(law_name(spec));
}
BENCHMARK(law_check)->DenseRange(0, 4)->Unit(benchmark::kMillisecond);

} // namespace
