// Full rebuild of a local palpation problem: supports, assembly, factorisation, solve with one active tool node; and
// the condensation onto the candidate patch that follows. Flat punch on a half-space block of half-width 4 radii, nu =
// 0.3, the configuration of the `punch` experiment with default options. BM_cholesky_900 is the yardstick of the
// machine.
#include "solvers/body/contact_rings.hpp"
#include "solvers/contact/solver.hpp"

#include <Eigen/Cholesky>
#include <benchmark/benchmark.h>
#include <cmath>
#include <map>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

extern "C" void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);

struct Case {
  Problem problem;
  std::vector<int> candidates;
};

Case make_case(Method method, int target) {
  constexpr double radius = 1, half_width = 4;
  const Vector3 centre = Vector3::Zero(), normal = Vector3::UnitZ();
  Case result;
  Problem& problem = result.problem;
  problem.domain = topology::make_box_domain(Vector3(-half_width, -half_width, -half_width),
                                             Vector3(half_width, half_width, 0), 0.5);
  problem.material = {1, 0.3, 0};
  double low = 0.05, high = 0.6;
  for (int trial = 0; trial < 10; ++trial) {
    const double fine = std::sqrt(low * high);
    SprinkleOptions options;
    options.spacing = edge_spacing(centre, normal, radius, fine, 10, 0.35);
    options.seeds = contact_rings(*problem.domain, centre, normal, radius, fine, contact_ring_offset(method));
    problem.nodes = sprinkle(*problem.domain, options).nodes;
    if (std::abs(problem.nodes.size() - target) < 0.02 * target)
      break;
    (problem.nodes.size() > target ? low : high) = fine;
  }
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (problem.nodes.kinds[i] == NodeKind::interior)
      continue;
    const bool far = std::max({std::abs(x.x()), std::abs(x.y()), -x.z()}) > half_width - 1e-9;
    if (far)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    else if (std::hypot(x.x(), x.y()) < radius)
      result.candidates.push_back(i);
  }
  problem.prescribed_region = [](const Vector3&, const Vector3& n) { return n.z() < 0.5; };
  return result;
}

const Case& cached_case(Method method, int target) {
  static std::map<std::pair<int, int>, Case> cases;
  const auto key = std::pair(static_cast<int>(method), target);
  const auto found = cases.find(key);
  return found != cases.end() ? found->second : cases.emplace(key, make_case(method, target)).first->second;
}

void rebuild(benchmark::State& state, Method method) {
  const Case& data = cached_case(method, static_cast<int>(state.range(0)));
  DiscretisationOptions options;
  options.method = method;
  options.estimate_condition = false;
  AssemblyReport report;
  for (auto _ : state) {
    const auto body = discretise(data.problem, options);
    benchmark::DoNotOptimize(body->force_responses({data.candidates.front()}));
    report = body->report();
  }
  state.counters["nodes"] = report.nodes;
  state.counters["supports_ms"] = 1e3 * report.supports_seconds;
  state.counters["assembly_ms"] = 1e3 * report.assembly_seconds;
  state.counters["factor_ms"] = 1e3 * report.factor_seconds;
  state.counters["factor_nonzeros"] = static_cast<double>(report.factor_nonzeros);
}

void condensation(benchmark::State& state, Method method) {
  const Case& data = cached_case(method, static_cast<int>(state.range(0)));
  DiscretisationOptions options;
  options.method = method;
  const auto body = discretise(data.problem, options);
  for (auto _ : state)
    benchmark::DoNotOptimize(condense(*body, data.candidates));
  state.counters["candidates"] = static_cast<double>(data.candidates.size());
}

void BM_rebuild_galerkin(benchmark::State& state) {
  rebuild(state, Method::galerkin);
}
void BM_rebuild_collocation(benchmark::State& state) {
  rebuild(state, Method::collocation);
}
void BM_condense_galerkin(benchmark::State& state) {
  condensation(state, Method::galerkin);
}
void BM_condense_collocation(benchmark::State& state) {
  condensation(state, Method::collocation);
}

/// The compliance alone, as a body has it that the next increment of a cut changes.
void BM_condense_galerkin_without_fields(benchmark::State& state) {
  const Case& data = cached_case(Method::galerkin, static_cast<int>(state.range(0)));
  const auto body = discretise(data.problem, {.method = Method::galerkin});
  for (auto _ : state)
    benchmark::DoNotOptimize(condense_without_fields(*body, data.candidates));
  state.counters["candidates"] = static_cast<double>(data.candidates.size());
}

void BM_cholesky_900(benchmark::State& state) {
  const int size = 900;
  const MatrixX seed = MatrixX::Random(size, size);
  const MatrixX matrix = seed * seed.transpose() + size * MatrixX::Identity(size, size);
  for (auto _ : state) {
    MatrixX factor = matrix;
    int info = 0;
    dpotrf_("L", &size, factor.data(), &size, &info);
    benchmark::DoNotOptimize(info);
  }
}

} // namespace

BENCHMARK(BM_cholesky_900)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_rebuild_galerkin)->Arg(300)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_rebuild_collocation)->Arg(300)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_condense_galerkin)->Arg(300)->Arg(1000)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_condense_galerkin_without_fields)->Arg(300)->Arg(1000)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_condense_collocation)->Arg(300)->Arg(1000)->Unit(benchmark::kMillisecond);
