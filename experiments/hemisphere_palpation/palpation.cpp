#include "experiments/hemisphere_palpation/palpation.hpp"

#include "experiments/support/sprinkle_to_count.hpp"
#include "experiments/support/stopwatch.hpp"
#include "solvers/body/contact_rings.hpp"
#include "solvers/published/published.hpp"
#include "solvers/shapes/tool_pattern.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double pi = std::numbers::pi;
constexpr double cap = hemisphere_cap_radius;
constexpr double slope = 0.3;   // growth of the spacing away from the cap, the same for every method
constexpr double plateau = 0.5; // in spacings: the rings carry the fine zone beyond the edge of the cap
const Vector3 pole = Vector3::UnitZ();

std::shared_ptr<const topology::Domain> half_ball() {
  return topology::make_hemisphere_domain(1, 0.04);
}

bool under_cap(const Vector3& x) {
  return x.z() > 0.5 && std::hypot(x.x(), x.y()) < cap;
}

solvers::SprinkleOptions sprinkle_options(const topology::Domain& domain, solvers::Method method, double fine,
                                          std::uint64_t seed) {
  solvers::SprinkleOptions options;
  options.random_seed = seed;
  options.spacing.fine = fine;
  options.spacing.coarse = 10;
  options.spacing.slope = slope;
  options.spacing.plateau = plateau;
  options.spacing.radius = cap;
  options.spacing.centres = {pole};
  options.seeds = solvers::contact_rings(domain, pole, pole, cap, fine, solvers::contact_ring_offset(method));
  return options;
}

constexpr int directions = 12;

/// Displacement in the half-plane of one direction (radial, circumferential, axial).
Vector3 displacement_at(const HemispherePalpation& run, double angle, int direction) {
  const double azimuth = 2 * pi * (direction + 0.37) / directions;
  const Vector3 radial(std::cos(azimuth), std::sin(azimuth), 0), around(-std::sin(azimuth), std::cos(azimuth), 0);
  const Vector3 x = (1 - 1e-9) * (std::sin(angle) * radial + std::cos(angle) * pole);
  try {
    const Vector3 u = run.body->at(x, run.field).displacement;
    return {u.dot(radial), u.dot(around), u.z()};
  } catch (const InputError&) { // no sphere covers this point: the paper's local nodes know nothing of it
    if (!run.local_nodes)
      throw;
    return Vector3::Zero();
  }
}

} // namespace

HemispherePalpation palpate_hemisphere(solvers::Method method, double poisson_ratio, int target, std::uint64_t seed) {
  HemispherePalpation run;
  solvers::Problem problem;
  problem.domain = half_ball();
  problem.material = {1, poisson_ratio, 0};
  const Stopwatch sprinkling;
  problem.nodes =
      sprinkle_to_count(
          *problem.domain, [&](double fine) { return sprinkle_options(*problem.domain, method, fine, seed); }, target,
          1.0 / std::cbrt(target))
          .sprinkling.nodes;
  run.sprinkle_seconds = sprinkling.seconds();
  std::vector<std::size_t> pushed;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (problem.nodes.kinds[i] == solvers::NodeKind::interior)
      continue;
    if (x.z() < 1e-9) {
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    } else if (under_cap(x)) {
      pushed.push_back(problem.prescribed.size());
      problem.prescribed.push_back({i, {true, true, true}, -pole});
    }
  }
  problem.prescribed_region = [](const Vector3& x, const Vector3& normal) { return normal.z() < -0.5 || under_cap(x); };
  solvers::DiscretisationOptions options;
  options.method = method;
  const Stopwatch build;
  run.body = solvers::discretise(std::move(problem), options);
  run.build_seconds = build.seconds();
  const Stopwatch solve;
  run.field = run.body->solve();
  const std::vector<Vector3> forces = run.body->constraint_forces(run.field);
  run.solve_seconds = solve.seconds();
  for (const std::size_t entry : pushed)
    run.force -= forces[entry].z();
  return run;
}

HemispherePalpation palpate_with_pattern(double poisson_ratio, double reach) {
  HemispherePalpation run;
  run.local_nodes = true;
  solvers::Problem problem;
  problem.domain = half_ball();
  problem.material = {1, poisson_ratio, 0};
  const Stopwatch sprinkling;
  const solvers::ToolPattern pattern = solvers::paper_pattern(reach);
  problem.nodes = solvers::place(pattern, *problem.domain, pole, pole);
  run.sprinkle_seconds = sprinkling.seconds();
  const int outermost = *std::max_element(pattern.shells.begin(), pattern.shells.end());
  problem.prescribed.push_back({0, {true, true, true}, -pole});
  for (int i = 1; i < pattern.size(); ++i)
    if (pattern.shells[i] == outermost)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  solvers::DiscretisationOptions options;
  options.method = solvers::Method::published;
  options.support_radius = solvers::pattern_support_radius;
  options.tip_node = 0;
  const Stopwatch build;
  run.body = solvers::discretise(std::move(problem), options);
  run.build_seconds = build.seconds();
  const Stopwatch solve;
  run.field = run.body->solve();
  run.solve_seconds = solve.seconds();
  run.force = -solvers::published_tip_force(*run.body, -pole).z();
  return run;
}

double surface_error(const HemispherePalpation& run, const HemisphereReference& reference, double angle) {
  const Eigen::Vector2d exact = reference.displacement(angle);
  double worst = 0;
  for (int k = 0; k < directions; ++k)
    worst = std::max(worst, (displacement_at(run, angle, k) - Vector3(exact.x(), 0, exact.y())).norm());
  return worst;
}

Eigen::Vector2d surface_displacement(const HemispherePalpation& run, double angle) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (int k = 0; k < directions; ++k) {
    const Vector3 u = displacement_at(run, angle, k);
    mean += Eigen::Vector2d(u.x(), u.z()) / directions;
  }
  return mean;
}

std::vector<double> judged_angles() {
  const double from = std::asin(1.2 * cap), to = 0.5 * pi - 0.01;
  constexpr int steps = 36;
  std::vector<double> angles;
  for (int k = 0; k <= steps; ++k)
    angles.push_back(from + (to - from) * k / steps);
  return angles;
}

} // namespace spherecut::experiments
