#include "experiments/support/half_space_contact.hpp"

#include "experiments/support/sprinkle_to_count.hpp"
#include "experiments/support/stopwatch.hpp"
#include "solvers/body/contact_rings.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

const Vector3 up = Vector3::UnitZ();

double from_axis(const Vector3& x) {
  return std::hypot(x.x(), x.y());
}

solvers::SprinkleOptions sprinkle_options(const topology::Domain& domain, const HalfSpaceCase& half_space,
                                          const std::shared_ptr<const topology::Incision>& incision, double fine) {
  constexpr double no_limit = 10 * half_width;
  solvers::SprinkleOptions options;
  options.random_seed = half_space.seed;
  if (half_space.indenter == Indenter::punch) {
    options.spacing = solvers::edge_spacing(Vector3::Zero(), up, contact_radius, fine, no_limit, spacing_slope);
    options.seeds = solvers::contact_rings(domain, Vector3::Zero(), up, contact_radius, fine,
                                           solvers::contact_ring_offset(half_space.method));
  } else {
    options.spacing.fine = fine;
    options.spacing.coarse = no_limit;
    options.spacing.slope = spacing_slope;
    options.spacing.radius = contact_radius;
    options.spacing.centres = {Vector3::Zero()};
    options.seeds = {{Vector3::Zero()}};
  }
  options.incision = incision;
  options.ring_ahead = solvers::wants_ring_ahead(half_space.method);
  return options;
}

} // namespace

HalfSpaceBody half_space_body(const HalfSpaceCase& half_space) {
  HalfSpaceBody result;
  solvers::Problem problem;
  problem.domain = topology::make_box_domain({-half_width, -half_width, -half_width}, {half_width, half_width, 0},
                                             0.5 * contact_radius);
  problem.material = {1, half_space.poisson_ratio, 0};
  if (!half_space.cut.empty())
    problem.incision = std::make_shared<topology::Incision>(half_space.cut, problem.domain);
  const Stopwatch sprinkling;
  const double guess = contact_radius * 2.2 / std::cbrt(half_space.target_nodes);
  const auto options_for = [&](double fine) {
    return sprinkle_options(*problem.domain, half_space, problem.incision, fine);
  };
  CountedSprinkling cloud =
      half_space.fine > 0
          ? CountedSprinkling{solvers::sprinkle(*problem.domain, options_for(half_space.fine)), half_space.fine}
          : sprinkle_to_count(*problem.domain, options_for, half_space.target_nodes, guess);
  result.sprinkle_seconds = sprinkling.seconds();
  result.fine = cloud.fine;
  problem.nodes = std::move(cloud.sprinkling.nodes);

  const double reach = half_space.indenter == Indenter::punch ? contact_radius : 1.3 * contact_radius + result.fine;
  std::vector<int> candidates;
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (problem.nodes.kinds[i] == solvers::NodeKind::interior || problem.nodes.kinds[i] == solvers::NodeKind::lip)
      continue;
    const double to_side = half_width - std::max(std::abs(x.x()), std::abs(x.y()));
    if (to_side < 1e-9 || x.z() < -half_width + 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    else if (from_axis(x) < reach)
      candidates.push_back(i);
  }
  problem.prescribed_region = [](const Vector3&, const Vector3& normal) { return normal.z() < 0.5; };

  solvers::DiscretisationOptions options;
  options.method = half_space.method;
  const Stopwatch build;
  result.body = solvers::discretise(std::move(problem), options);
  result.build_seconds = build.seconds();
  const Stopwatch condensation;
  result.patch = solvers::condense(*result.body, candidates, solvers::HalfSpaceCoupling{});
  result.condense_seconds = condensation.seconds();
  return result;
}

std::vector<SurfaceSample> surface_profile(const HalfSpaceBody& half_space, const solvers::Field& field, double from,
                                           double to, const std::function<double(double r)>& exact) {
  constexpr int directions = 6, steps = 40;
  std::vector<SurfaceSample> profile;
  for (int k = 0; k <= steps; ++k) {
    SurfaceSample sample;
    sample.r = from + (to - from) * k / steps;
    for (int direction = 0; direction < directions; ++direction) {
      const double angle = 2 * std::numbers::pi * (direction + 0.3) / directions;
      // Just inside, so that the point belongs to the body whatever the rounding.
      const Vector3 x(sample.r * std::cos(angle), sample.r * std::sin(angle), -1e-12);
      const double depth = -half_space.body->at(x, field).displacement.z();
      sample.mean += depth / directions;
      sample.largest_error = std::max(sample.largest_error, std::abs(depth - exact(sample.r)));
    }
    profile.push_back(sample);
  }
  return profile;
}

double far_force_imbalance(const HalfSpaceBody& half_space, const solvers::ContactState& state,
                           const solvers::Field& field) {
  Vector3 far = Vector3::Zero();
  for (const Vector3& force : half_space.body->constraint_forces(field))
    far += force;
  return (far - state.tool_force).norm() / state.tool_force.norm();
}

std::vector<std::string> half_space_columns() {
  return {"method",        "poisson_ratio", "seed",        "nodes",    "spacing_m",  "force_over_exact",
          "profile_error", "far_imbalance", "sprinkle_ms", "build_ms", "condense_ms"};
}

std::vector<std::string> half_space_row(const HalfSpaceCase& half_space, const HalfSpaceBody& body, double force_ratio,
                                        double profile_error, double imbalance) {
  return {std::string(solvers::to_string(half_space.method)),
          fmt::format("{}", half_space.poisson_ratio),
          fmt::format("{}", half_space.seed),
          fmt::format("{}", body.nodes()),
          fmt::format("{:.4f}", body.fine),
          fmt::format("{:.4f}", force_ratio),
          fmt::format("{:.4f}", profile_error),
          fmt::format("{:.1e}", imbalance),
          fmt::format("{:.1f}", 1e3 * body.sprinkle_seconds),
          fmt::format("{:.1f}", 1e3 * body.build_seconds),
          fmt::format("{:.1f}", 1e3 * body.condense_seconds)};
}

} // namespace spherecut::experiments
