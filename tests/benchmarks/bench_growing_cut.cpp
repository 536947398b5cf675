// One 2 mm increment of a growing cut: a block of 60 x 60 x 30 mm, base held, an upright blade 15 mm deep that runs in
// from the side along a slanted line, off every axis and cell. Times are those of the update with real sight lines,
// including the condensation to the contact; the window covers the next `ahead` increments of the known path, or a fan
// of +-45 degrees for an unknown one. Beside it: condensing anew (the background's work) and a full rebuild.
// BM_cholesky_900 (bench_rebuild) is the yardstick of the machine.
#include "solvers/appended/appended_body.hpp"
#include "solvers/cut/growing_body.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/finite/equilibrium.hpp"
#include "solvers/finite/transfer.hpp"
#include "topology/blade/blade.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <algorithm>
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
  std::vector<bool> retired;
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
    retired.assign(nodes.size(), false);
  }

  void advance() {
    sweep.move_to({time += 1, Vector3(-0.0619, 0.0013, 0) + travelled * heading});
    travelled += step;
  }
  /// Makes the nodes those of the cut as it is now; `before` is the one that they were made for.
  SprinkleIncrement extend_nodes(const topology::Incision* before) {
    sprinkling.incision = sweep.incision();
    SprinkleIncrement change = extend_sprinkling(*domain, sprinkling, nodes, before, retired);
    for (const int node : change.removed)
      retired[node] = true;
    for (int j = 0; j < change.added.size(); ++j)
      nodes.add(change.added, j);
    retired.resize(nodes.size(), false);
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

  /// The strip that the next `length` of the known path will cut.
  [[nodiscard]] topology::SurfaceMesh strip(const Vector3& way, double length) const {
    return topology::make_rectangle_sheet(tip() + 0.5 * length * way - 0.5 * depth * Vector3::UnitZ(),
                                          way.cross(Vector3::UnitZ()), Vector3::UnitZ(), length, depth, 0.001);
  }

  [[nodiscard]] GrowthOptions options(int ahead, bool fan, SightRule sight) const {
    GrowthOptions o;
    o.method.sight = sight;
    o.method.estimate_condition = false;
    const double length = ahead * step;
    const Vector3 across = Vector3::UnitZ().cross(heading);
    // Known path: the strip ahead. Unknown: a fan of directions, sampled by three strips.
    for (double angle : fan ? std::vector<double>{-0.785, 0, 0.785} : std::vector<double>{0}) {
      const Vector3 way = std::cos(angle) * heading + std::sin(angle) * across;
      const topology::SurfaceMesh one = strip(way, length);
      const int offset = static_cast<int>(o.way.vertices.size());
      o.way.vertices.insert(o.way.vertices.end(), one.vertices.begin(), one.vertices.end());
      for (const Triangle& t : one.triangles)
        o.way.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] == NodeKind::surface && nodes.positions[i].z() > -1e-9 &&
          (nodes.positions[i] - tip() - 0.006 * heading).norm() < 0.009)
        o.contact.push_back(i);
    return o;
  }
};

void growth(benchmark::State& state, int ahead, bool fan, SightRule sight) {
  constexpr int increments = 3;
  GrowthReport sum;
  double worst = 0, sprinkle_seconds = 0, prepare_seconds = 0, anew = 0;
  int count = 0, unknowns = 0, factored = 0, unprepared = 0, condensed = 0, nodes = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)));
    const auto start = std::chrono::steady_clock::now();
    GrowingCut cut(scene.problem(), scene.options(ahead, fan, sight));
    anew += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    nodes = scene.nodes.size();
    double seconds = 0;
    for (int k = 0; k < increments; ++k) {
      const auto before = scene.sweep.incision();
      scene.advance();
      const auto sprinkle_start = std::chrono::steady_clock::now();
      const SprinkleIncrement increment = scene.extend_nodes(before.get());
      sprinkle_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - sprinkle_start).count();
      const NodeChange change{increment.removed, increment.added};
      if (!fan) // the path is scripted: the next increment is known before the blade is there
        prepare_seconds += cut.prepare(change, scene.sweep.incision());
      const GrowthReport report = cut.grow(change, scene.sweep.incision());
      condensed += report.condensed_anew ? 1 : 0;
      seconds += report.total_seconds;
      worst = std::max(worst, report.total_seconds);
      sum.boxes += report.boxes;
      sum.spheres_seconds += report.spheres_seconds;
      sum.cells_seconds += report.cells_seconds;
      sum.factor_seconds += report.factor_seconds;
      sum.condense_seconds += report.condense_seconds;
      factored = std::max(factored, report.factored);
      unprepared += report.prepared ? 0 : 1;
      unknowns = cut.window_unknowns();
      ++count;
    }
    state.SetIterationTime(seconds / increments);
  }
  state.counters["nodes"] = nodes;
  state.counters["window"] = unknowns;
  state.counters["factored"] = factored;
  state.counters["unprepared"] = unprepared;
  state.counters["prepare_ms"] = 1e3 * prepare_seconds / count;
  state.counters["boxes"] = static_cast<double>(sum.boxes) / count;
  state.counters["spheres_ms"] = 1e3 * sum.spheres_seconds / count;
  state.counters["cells_ms"] = 1e3 * sum.cells_seconds / count;
  state.counters["factor_ms"] = 1e3 * sum.factor_seconds / count;
  state.counters["condense_ms"] = 1e3 * sum.condense_seconds / count;
  state.counters["worst_ms"] = 1e3 * worst;
  state.counters["sprinkle_ms"] = 1e3 * sprinkle_seconds / count;
  state.counters["anew_ms"] = 1e3 * anew * increments / count;
  state.counters["left_window"] = condensed;
}

/// The same where the cut appends unknowns, path unknown, at nu in hundredths: the time is that of the update and of
/// the condensation to the contact, which follows it.
void growth_by_appending(benchmark::State& state) {
  constexpr int increments = 3;
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  double seconds = 0, condense_seconds = 0, sprinkle_seconds = 0, anew = 0;
  int count = 0, unknowns = 0, nodes = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)), Method::galerkin, true);
    scene.poisson_ratio = 0.01 * static_cast<double>(state.range(1));
    DiscretisationOptions options;
    options.sight = SightRule::appended;
    options.estimate_condition = false;
    const std::vector<int> contact = scene.options(4, true, SightRule::appended).contact;
    auto start = Clock::now();
    AppendedBody body(scene.problem(), options);
    anew += since(start);
    benchmark::DoNotOptimize(body.contact_compliance(contact));
    nodes = scene.nodes.size();
    double own = 0;
    for (int k = 0; k < increments; ++k) {
      const auto before = scene.sweep.incision();
      scene.advance();
      start = Clock::now();
      const SprinkleIncrement change = scene.extend_nodes(before.get());
      sprinkle_seconds += since(start);
      start = Clock::now();
      body.grow(change, scene.problem(), {}, true);
      own += since(start);
      start = Clock::now();
      benchmark::DoNotOptimize(body.contact_compliance(contact));
      condense_seconds += since(start);
      own += since(start);
      unknowns = body.coefficient_count() - 3 * body.sphere_count();
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
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
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

/// The same with method collocation, whose body prepares itself; condensed to the contact with `condense_seconds`.
void growth_of_collocation(benchmark::State& state, SightRule sight) {
  constexpr int increments = 3;
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  GrowthReport sum;
  double anew = 0, rebuild = 0, compliance = 0, prepared_seconds = 0;
  int count = 0, condensed = 0, prepared = 0;
  for (auto _ : state) {
    Scene scene(static_cast<int>(state.range(0)), Method::collocation);
    GrowthOptions options = scene.options(4, false, sight);
    options.method.method = Method::collocation;
    std::vector<Vector3> candidates;
    for (const int node : options.contact)
      candidates.push_back(scene.nodes.positions[node]);
    auto start = Clock::now();
    const auto body = make_growable(scene.problem(), options);
    anew += since(start);
    double seconds = 0;
    for (int k = 0; k <= increments; ++k) {
      const auto before = scene.sweep.incision();
      scene.advance();
      scene.sprinkling.incision = scene.sweep.incision();
      const SprinkleIncrement change =
          extend_sprinkling(*scene.domain, scene.sprinkling, scene.nodes, before.get(), scene.retired);
      NodeCloud next;
      for (int i = 0, r = 0; i < scene.nodes.size(); ++i)
        if (r < std::ssize(change.removed) && change.removed[static_cast<std::size_t>(r)] == i)
          ++r;
        else
          next.add(scene.nodes, i);
      for (int j = 0; j < change.added.size(); ++j)
        next.add(change.added, j);
      scene.nodes = std::move(next);
      scene.retired.assign(scene.nodes.size(), false);
      start = Clock::now();
      const GrowthReport report = dynamic_cast<Growable&>(*body).grow(change, scene.problem(), {}, false).update;
      std::vector<int> contact;
      for (const Vector3& x : candidates)
        if (const auto found = std::find(scene.nodes.positions.begin(), scene.nodes.positions.end(), x);
            found != scene.nodes.positions.end())
          contact.push_back(static_cast<int>(found - scene.nodes.positions.begin()));
      const auto condensing = Clock::now();
      benchmark::DoNotOptimize(body->contact_compliance(contact));
      if (k == 0) // what is eliminated ahead is chosen
        continue;
      compliance += since(condensing);
      const double whole = since(start);
      seconds += whole;
      if (report.prepared) {
        prepared_seconds += whole;
        ++prepared;
      }
      condensed += report.condensed_anew ? 1 : 0;
      sum.boxes += report.boxes;
      sum.factored += report.factored;
      sum.window_nodes += report.window_nodes;
      sum.spheres_seconds += report.spheres_seconds;
      sum.cells_seconds += report.cells_seconds;
      sum.factor_seconds += report.factor_seconds;
      ++count;
    }
    state.SetIterationTime(seconds / increments);
    start = Clock::now();
    benchmark::DoNotOptimize(discretise(scene.problem(), options.method));
    rebuild += since(start);
    state.counters["nodes"] = scene.nodes.size();
  }
  state.counters["window"] = static_cast<double>(sum.window_nodes) / count;
  state.counters["factored"] = static_cast<double>(sum.factored) / count;
  state.counters["rows"] = static_cast<double>(sum.boxes) / count;
  state.counters["spheres_ms"] = 1e3 * sum.spheres_seconds / count;
  state.counters["cells_ms"] = 1e3 * sum.cells_seconds / count;
  state.counters["factor_ms"] = 1e3 * sum.factor_seconds / count;
  state.counters["condense_ms"] = 1e3 * compliance / count;
  state.counters["anew_ms"] = 1e3 * anew * increments / count;
  state.counters["rebuild_ms"] = 1e3 * rebuild * increments / count;
  state.counters["left_window"] = condensed;
  state.counters["prepared"] = prepared;
  state.counters["prepared_ms"] = prepared > 0 ? 1e3 * prepared_seconds / prepared : 0;
}

void BM_growing_cut_collocation(benchmark::State& state) {
  growth_of_collocation(state, SightRule::enriched);
}
void BM_growing_cut_appended(benchmark::State& state) {
  growth_by_appending(state);
}
void BM_growing_cut_finite(benchmark::State& state) {
  growth_at_finite_strain(state);
}
void BM_growing_cut_enriched(benchmark::State& state) {
  growth(state, 3, false, SightRule::enriched);
}
void BM_growing_cut_diffraction(benchmark::State& state) {
  growth(state, 3, false, SightRule::diffraction);
}
void BM_growing_cut_diffraction_unknown_path(benchmark::State& state) {
  growth(state, 3, true, SightRule::diffraction);
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
BENCHMARK(BM_growing_cut_diffraction_unknown_path)->Apply(at_three_sizes);
