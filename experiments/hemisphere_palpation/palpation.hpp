// One run of the hemisphere palpation with a discretisation under test; the references are in reference.hpp.
#pragma once

#include "experiments/hemisphere_palpation/reference.hpp"
#include "solvers/body/discretisation.hpp"

namespace spherecut::experiments {

/// A palpation to depth 1 m on a half ball of radius 1 m and Young's modulus 1 Pa: results scale as those of the
/// reference do.
struct HemispherePalpation {
  std::unique_ptr<solvers::Discretisation> body;
  solvers::Field field;
  double force = 0;         // N, push of the cap on the body
  bool local_nodes = false; // the nodes fill a neighbourhood of the tip alone, not the body
  double sprinkle_seconds = 0, build_seconds = 0, solve_seconds = 0;
  [[nodiscard]] int nodes() const { return body->report().nodes; }
};

/// Nodes sprinkled over the whole half ball, finest at the cap, about `target` in all.
HemispherePalpation palpate_hemisphere(solvers::Method method, double poisson_ratio, int target, std::uint64_t seed);

/// The paper's way: its pattern of 34 nodes about the tip, the outermost shell held, the tip's unknown prescribed.
HemispherePalpation palpate_with_pattern(double poisson_ratio, double reach);

/// Displacement error of the surface at one angle from the pole (rad), the largest of several directions, m. A point
/// that no sphere covers does not move where the nodes are local; elsewhere it throws InputError.
double surface_error(const HemispherePalpation& run, const HemisphereReference& reference, double angle);

/// Mean displacement (radial, axial) of the surface at one angle, m.
Eigen::Vector2d surface_displacement(const HemispherePalpation& run, double angle);

/// Where the error is judged: from 1.2 contact radii to just above the base, rad.
std::vector<double> judged_angles();

} // namespace spherecut::experiments
