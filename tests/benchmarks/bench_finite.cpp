// A warm step of palpation at finite strain: a block of 60 x 60 x 40 mm, neo-Hookean, nu = 0.49, its base held, a ball
// of 12 mm radius that goes up and down about a depth of 8 mm in steps of 0.5 mm. Iterations and evaluations are means
// of a step. BM_cholesky_900 is the yardstick of the machine.
#include "solvers/finite/equilibrium.hpp"

#include <benchmark/benchmark.h>
#include <cmath>
#include <map>

namespace {

using namespace spherecut;
using namespace spherecut::solvers;

struct PressedBlock {
  std::unique_ptr<FiniteBody> body;
  std::unique_ptr<Equilibrium> equilibrium;
};

constexpr double top = 0.04, deepest = 0.010, shallowest = 0.006, step = 0.0005; // m

topology::ToolPose pose_at_depth(double depth) {
  return {{0.03, 0.03, top - depth}, Vector3::UnitZ()};
}

PressedBlock make_pressed_block(int target) {
  Problem problem;
  problem.domain = topology::make_box_domain(Vector3::Zero(), Vector3(0.06, 0.06, top), 0.005);
  SprinkleOptions options;
  options.spacing = spacing_for_count(*problem.domain, {}, target, options);
  problem.nodes = sprinkle(*problem.domain, options).nodes;
  problem.touched_from = Vector3::UnitZ();
  std::vector<int> candidates;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (problem.nodes.kinds[i] == NodeKind::interior)
      continue;
    if (x.z() < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    else if (x.z() > top - 1e-9 && std::hypot(x.x() - 0.03, x.y() - 0.03) < 0.016)
      candidates.push_back(i);
  }
  problem.prescribed_region = [](const Vector3& x, const Vector3& normal) { return x.z() < 1e-9 && normal.z() < -0.5; };
  const double modulus = 3000;
  std::shared_ptr<const Law> law = make_law({NeoHookeanLaw{modulus}, bulk_modulus_of(modulus, 0.49), {}});
  PressedBlock result;
  result.body = std::make_unique<FiniteBody>(std::move(problem), law);
  result.equilibrium = std::make_unique<Equilibrium>(*result.body);
  result.equilibrium->set_contact(topology::SphereTip{0.012}, candidates);
  for (double depth = step; depth < shallowest; depth += step)
    result.equilibrium->solve({{}, 1, pose_at_depth(depth)});
  return result;
}

void BM_finite_palpation(benchmark::State& state) {
  static std::map<int, PressedBlock> made;
  const int target = static_cast<int>(state.range(0));
  auto found = made.find(target);
  if (found == made.end())
    found = made.emplace(target, make_pressed_block(target)).first;
  Equilibrium& equilibrium = *found->second.equilibrium;
  double depth = shallowest, way = step;
  long iterations = 0, evaluations = 0, steps = 0;
  EquilibriumStatus last;
  for (auto _ : state) {
    last = equilibrium.solve({{}, 1, pose_at_depth(depth)});
    iterations += last.iterations;
    evaluations += last.evaluations;
    ++steps;
    if (depth + way > deepest || depth + way < shallowest)
      way = -way;
    depth += way;
  }
  state.counters["nodes"] = found->second.body->size();
  state.counters["iterations"] = static_cast<double>(iterations) / static_cast<double>(steps);
  state.counters["evaluations"] = static_cast<double>(evaluations) / static_cast<double>(steps);
  state.counters["touching"] = last.touching;
}
BENCHMARK(BM_finite_palpation)->Arg(300)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);

} // namespace
