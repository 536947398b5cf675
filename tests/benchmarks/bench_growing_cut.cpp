// One 2 mm increment of a growing cut: a block of 60 x 60 x 30 mm, base held, an upright blade 15 mm deep that runs in
// from the side along a slanted line, off every axis and cell, its way ahead unknown. A cut that appends is followed by
// its body; by the other rules nodes beside it are exchanged and the body is assembled anew. Times have real sight
// lines and the condensation to the contact. BM_cholesky_900 (bench_rebuild) is the yardstick of the machine.
#include "experiments/support/exchanged_nodes.hpp"
#include "solvers/appended/appended_body.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/finite/equilibrium.hpp"
#include "solvers/finite/transfer.hpp"
#include "topology/blade/blade.hpp"

#include <benchmark/benchmark.h>
#include <chrono>
#include <cmath>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

constexpr double step = 0.002, depth = 0.0153;
const Vector3 heading = Vector3(1, 0.083, 0).normalized();

struct Scene {
  std::shared_ptr<const topology::Domain> domain =
      topology::make_box_domain({-0.03, -0.03, -0.03}, {0.03, 0.03, 0}, 0.004);
  topology::BladeSweep sweep;
  SprinkleOptions sprinkling;
  NodeCloud nodes;
  double travelled = 0, time = 0, poisson_ratio = 0.4;

  explicit Scene(int target, Method method = Method::galerkin, bool lips_apart = false)
      : sweep({{{0, 0, -depth}, {0, 0, 0.004}}, 1e-4}, domain, {.edge = 0.002}) {
    for (int k = 0; k < 24; ++k) // from outside to 15 mm inside
      advance();
    sprinkling.incision = sweep.incision();
    sprinkling.ring_ahead = wants_ring_ahead(method);
    sprinkling.lips_apart = lips_apart;
    double low = 0.002, high = 0.02;
    for (int trial = 0; trial < 12; ++trial) {
      sprinkling.spacing.fine = sprinkling.spacing.coarse = std::sqrt(low * high);
      nodes = sprinkle(*domain, sprinkling).nodes;
      if (std::abs(nodes.size() - target) < 0.02 * target)
        break;
      (nodes.size() > target ? low : high) = sprinkling.spacing.fine;
    }
  }

  void advance() {
    sweep.move_to({time += 1, Vector3(-0.0619, 0.0013, 0) + travelled * heading});
    travelled += step;
  }
  /// Makes the nodes those of the cut as it is now; `before` is the one that they were made for.
  SprinkleIncrement extend_nodes(const topology::Incision* before) {
    sprinkling.incision = sweep.incision();
    SprinkleIncrement change = extend_sprinkling(*domain, sprinkling, nodes, before);
    nodes = experiments::exchanged(nodes, change);
    return change;
  }
  [[nodiscard]] Vector3 tip() const { return Vector3(-0.0619, 0.0013, 0) + (travelled - step) * heading; }

  [[nodiscard]] Problem problem() const {
    Problem p;
    p.domain = domain;
    p.incision = sweep.incision();
    p.nodes = nodes;
    p.material = {5000, poisson_ratio, 1000};
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] != NodeKind::interior && nodes.positions[i].z() < -0.03 + 1e-9)
        p.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    p.prescribed_region = [](const Vector3& x, const Vector3& normal) { return normal.z() < -0.5 && x.z() < -0.029; };
    return p;
  }

  /// Surface nodes about a place ahead of the blade, which a tool may touch.
  [[nodiscard]] std::vector<int> contact() const {
    const Vector3 place = tip() + 0.006 * heading;
    std::vector<int> candidates;
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] == NodeKind::surface && nodes.positions[i].z() > -1e-9 &&
          (nodes.positions[i] - place).norm() < 0.009)
        candidates.push_back(i);
    return candidates;
  }
};

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// On nodes that are exchanged beside the cut, assembled anew: the time is that of the assembly and of the
/// condensation.
void growth_by_rebuilding(benchmark::State& state, Method method, SightRule sight) {
  constexpr int increments = 3;
  DiscretisationOptions options;
  options.method = method;
  options.sight = sight;
  options.estimate_condition = false;
  double spheres_seconds = 0, factor_seconds = 0, rebuild_seconds = 0, condense_seconds = 0, sprinkle_seconds = 0;
  int count = 0, nodes = 0, removed = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)), method);
    nodes = scene.nodes.size();
    double own = 0;
    for (int k = 0; k < increments; ++k) {
      const auto before = scene.sweep.incision();
      scene.advance();
      auto start = Clock::now();
      removed += static_cast<int>(scene.extend_nodes(before.get()).removed.size());
      sprinkle_seconds += since(start);
      start = Clock::now();
      const std::unique_ptr<Discretisation> body = discretise(scene.problem(), options);
      rebuild_seconds += since(start);
      own += since(start);
      const std::vector<int> contact = scene.contact();
      start = Clock::now();
      benchmark::DoNotOptimize(body->contact_compliance(contact));
      condense_seconds += since(start);
      own += since(start);
      spheres_seconds += body->report().supports_seconds;
      factor_seconds += body->report().factor_seconds;
      ++count;
    }
    state.SetIterationTime(own / increments);
  }
  state.counters["nodes"] = nodes;
  state.counters["exchanged"] = static_cast<double>(removed) / count;
  state.counters["rebuild_ms"] = 1e3 * rebuild_seconds / count;
  state.counters["spheres_ms"] = 1e3 * spheres_seconds / count;
  state.counters["factor_ms"] = 1e3 * factor_seconds / count;
  state.counters["condense_ms"] = 1e3 * condense_seconds / count;
  state.counters["sprinkle_ms"] = 1e3 * sprinkle_seconds / count;
}

/// Where the cut appends unknowns, at nu in hundredths: the time is that of what the body does to follow it and of the
/// condensation to the contact.
void growth_by_appending(benchmark::State& state) {
  constexpr int increments = 3;
  double seconds = 0, condense_seconds = 0, sprinkle_seconds = 0, anew = 0;
  int count = 0, unknowns = 0, nodes = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)), Method::galerkin, true);
    scene.poisson_ratio = 0.01 * static_cast<double>(state.range(1));
    DiscretisationOptions options;
    options.sight = SightRule::appended;
    options.tip_functions = false; // as a session has it
    options.estimate_condition = false;
    const std::vector<int> contact = scene.contact();
    auto start = Clock::now();
    auto body = std::make_unique<AppendedBody>(scene.problem(), options);
    anew += since(start);
    benchmark::DoNotOptimize(body->contact_compliance(contact));
    nodes = scene.nodes.size();
    double own = 0;
    for (int k = 0; k < increments; ++k) {
      const auto before = scene.sweep.incision();
      scene.advance();
      start = Clock::now();
      const SprinkleIncrement change = scene.extend_nodes(before.get());
      sprinkle_seconds += since(start);
      start = Clock::now();
      body = body->copy(); // the body as it is goes on meanwhile
      if (const std::string why_not = body->grow(change, scene.problem()); !why_not.empty())
        state.SkipWithError(why_not.c_str());
      own += since(start);
      start = Clock::now();
      benchmark::DoNotOptimize(body->contact_compliance(contact));
      condense_seconds += since(start);
      own += since(start);
      unknowns = body->coefficient_count() - 3 * body->sphere_count();
      ++count;
    }
    seconds += own;
    state.SetIterationTime(own / increments);
  }
  state.counters["nodes"] = nodes;
  state.counters["appended"] = unknowns;
  state.counters["grow_ms"] = 1e3 * (seconds - condense_seconds) / count;
  state.counters["condense_ms"] = 1e3 * condense_seconds / count;
  state.counters["sprinkle_ms"] = 1e3 * sprinkle_seconds / count;
  state.counters["anew_ms"] = 1e3 * anew * increments / count;
}

/// The same at finite strain, neo-Hookean, nu in hundredths, the block 8 % shorter across the cut than it would be, and
/// factored before it was cut: the body with its functions, the factored tangent at rest, the state to begin from, and
/// the way to equilibrium.
void growth_at_finite_strain(benchmark::State& state) {
  constexpr int increments = 3;
  const double modulus = 5000, poisson_ratio = 0.01 * static_cast<double>(state.range(1)),
               shear = modulus / (2 * (1 + poisson_ratio));
  const std::shared_ptr<const Law> law = make_law({NeoHookeanLaw{shear}, bulk_modulus_of(shear, poisson_ratio), {}});
  const FiniteOptions options{.sight = SightRule::appended};
  double body_seconds = 0, rest_seconds = 0, start_seconds = 0, solve_seconds = 0;
  int count = 0, nodes = 0, appended = 0, iterations = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)), Method::galerkin, true);
    scene.poisson_ratio = poisson_ratio;
    const auto problem = [&] {
      Problem here = scene.problem();
      here.loads.initial_strain(1, 1) = -0.08;
      return here;
    };
    Problem whole = problem();
    whole.incision = nullptr;
    const FiniteBody uncut(whole, law, options);
    const Equilibrium factored(uncut);
    auto before = std::make_unique<FiniteBody>(problem(), law, options, nullptr, uncut.cut_functions()->uncut());
    auto equilibrium = std::make_unique<Equilibrium>(*before, EquilibriumOptions{}, factored.lineage());
    equilibrium->solve({});
    nodes = scene.nodes.size();
    double own = 0;
    for (int k = 0; k < increments; ++k) {
      const auto was = scene.sweep.incision();
      scene.advance();
      scene.extend_nodes(was.get());
      const auto begin = Clock::now();
      auto body = std::make_unique<FiniteBody>(problem(), law, options, nullptr, before->cut_functions()->uncut());
      body_seconds += since(begin);
      auto start = Clock::now();
      auto next = std::make_unique<Equilibrium>(*body, EquilibriumOptions{}, equilibrium->lineage());
      rest_seconds += since(start);
      start = Clock::now();
      const VectorX& old = equilibrium->coefficients();
      std::vector<char> is_new;
      VectorX from = body->cut_functions()->state_from(*before->cut_functions(), old, is_new);
      ShapeFunctions shape;
      next->set_coefficients(nearest_state(*body, std::move(from), is_new,
                                           [&](const Vector3& x) -> Matrix3 {
                                             Matrix3 deformation = Matrix3::Identity();
                                             before->shape_at(x, shape);
                                             for (int f = 0; f < shape.size(); ++f)
                                               deformation +=
                                                   old.segment<3>(3 * shape.nodes[f]) * shape.gradient(f).transpose();
                                             return deformation;
                                           }),
                             1);
      start_seconds += since(start);
      start = Clock::now();
      if (next->lineage().border == nullptr)
        state.SkipWithError("the tangent is factored anew");
      iterations += next->solve({}).iterations;
      solve_seconds += since(start);
      own += since(begin);
      appended = body->cut_functions()->appended();
      equilibrium = std::move(next);
      before = std::move(body);
      ++count;
    }
    state.SetIterationTime(own / increments);
  }
  state.counters["nodes"] = nodes;
  state.counters["appended"] = appended;
  state.counters["body_ms"] = 1e3 * body_seconds / count;
  state.counters["tangent_ms"] = 1e3 * rest_seconds / count;
  state.counters["start_ms"] = 1e3 * start_seconds / count;
  state.counters["solve_ms"] = 1e3 * solve_seconds / count;
  state.counters["iterations"] = static_cast<double>(iterations) / count;
}

void BM_growing_cut_collocation(benchmark::State& state) {
  growth_by_rebuilding(state, Method::collocation, SightRule::enriched);
}
void BM_growing_cut_appended(benchmark::State& state) {
  growth_by_appending(state);
}
void BM_growing_cut_finite(benchmark::State& state) {
  growth_at_finite_strain(state);
}
void BM_growing_cut_enriched(benchmark::State& state) {
  growth_by_rebuilding(state, Method::galerkin, SightRule::enriched);
}
void BM_growing_cut_diffraction(benchmark::State& state) {
  growth_by_rebuilding(state, Method::galerkin, SightRule::diffraction);
}

void at_three_sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->Arg(300)->Arg(1000)->Arg(2000)->UseManualTime()->Iterations(2)->Unit(benchmark::kMillisecond);
}

void at_three_sizes_and_two_ratios(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgsProduct({{300, 1000, 2000}, {30, 49}})
      ->ArgNames({"nodes", "nu"})
      ->UseManualTime()
      ->Iterations(2)
      ->Unit(benchmark::kMillisecond);
}

} // namespace

BENCHMARK(BM_growing_cut_appended)->Apply(at_three_sizes_and_two_ratios);
BENCHMARK(BM_growing_cut_finite)->Apply(at_three_sizes_and_two_ratios);
BENCHMARK(BM_growing_cut_collocation)->Apply(at_three_sizes);
BENCHMARK(BM_growing_cut_enriched)->Apply(at_three_sizes);
BENCHMARK(BM_growing_cut_diffraction)->Apply(at_three_sizes);
