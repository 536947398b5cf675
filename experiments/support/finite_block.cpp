#include "experiments/support/finite_block.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace spherecut::experiments {

namespace {

/// Face of a surface normal along an axis.
int face_of(const Vector3& normal) {
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  return 2 * axis + (normal[axis] > 0 ? 1 : 0);
}

/// Holds the faces of the block: its surface, and the nodes that lie on them.
void hold_faces(solvers::Problem& problem, const FiniteBlock& block) {
  const HeldFaces held = block.held;
  const bool whole = std::all_of(held.begin(), held.end(), [](const auto& axes) {
    return axes == std::array{true, true, true} || axes == std::array{false, false, false};
  });
  if (whole)
    problem.prescribed_region = [held](const Vector3&, const Vector3& normal) { return held[face_of(normal)][0]; };
  else
    problem.prescribed_region = [held](const Vector3&, const Vector3& normal, int axis) {
      return held[face_of(normal)][axis];
    };
  const solvers::NodeCloud& nodes = problem.nodes;
  for (int node = 0; node < nodes.size(); ++node) {
    if (nodes.kinds[node] == solvers::NodeKind::interior ||
        (block.lips_apart && nodes.kinds[node] == solvers::NodeKind::lip))
      continue;
    std::array<bool, 3> along{};
    for (int axis = 0; axis < 3; ++axis)
      for (const bool high : {false, true}) {
        const double off = nodes.positions[node][axis] - (high ? block.upper : block.lower)[axis];
        if (std::abs(off) > 1e-6 * nodes.spacings[node])
          continue;
        for (int k = 0; k < 3; ++k)
          along[k] = along[k] || held[2 * axis + (high ? 1 : 0)][k];
      }
    if (whole && along[0])
      problem.prescribed.push_back({node, {true, true, true}, Vector3::Zero()});
    else if (!whole)
      for (int k = 0; k < 3; ++k)
        if (along[k])
          problem.prescribed.push_back({node, {k == 0, k == 1, k == 2}, Vector3::Zero()});
  }
}

} // namespace

solvers::Problem finite_block(const FiniteBlock& block) {
  solvers::Problem problem;
  problem.domain = topology::make_box_domain(block.lower, block.upper, block.spacing);
  if (!block.cuts.empty())
    problem.incision = std::make_shared<topology::Incision>(block.cuts, problem.domain);
  if (block.graded) {
    solvers::SprinkleOptions options;
    options.spacing = *block.graded;
    options.incision = problem.incision;
    options.lips_apart = block.lips_apart;
    options.random_seed = block.seed;
    problem.nodes = solvers::sprinkle(*problem.domain, options).nodes;
    hold_faces(problem, block);
    return problem;
  }
  const Vector3 extent = block.upper - block.lower;
  std::array<int, 3> divisions{};
  Vector3 step;
  for (int axis = 0; axis < 3; ++axis) {
    divisions[axis] = std::max(2, static_cast<int>(std::lround(extent[axis] / block.spacing)));
    step[axis] = extent[axis] / divisions[axis];
  }
  std::mt19937_64 random(block.seed);
  std::uniform_real_distribution<double> shift(-block.jitter, block.jitter);
  for (int a = 0; a <= divisions[0]; ++a)
    for (int b = 0; b <= divisions[1]; ++b)
      for (int c = 0; c <= divisions[2]; ++c) {
        const std::array<int, 3> index{a, b, c};
        Vector3 x, normal = Vector3::Zero();
        int faces = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double move = shift(random) * step[axis];
          const bool low = index[axis] == 0, high = index[axis] == divisions[axis];
          x[axis] = low    ? block.lower[axis]
                    : high ? block.upper[axis]
                           : block.lower[axis] + index[axis] * step[axis] + move;
          if (!low && !high)
            continue;
          normal[axis] = low ? -1 : 1;
          ++faces;
        }
        const solvers::NodeKind kind = faces == 0   ? solvers::NodeKind::interior
                                       : faces == 1 ? solvers::NodeKind::surface
                                                    : solvers::NodeKind::edge;
        problem.nodes.add(x, block.spacing, kind, faces > 0 ? Vector3(normal.normalized()) : Vector3(normal));
      }
  hold_faces(problem, block);
  return problem;
}

std::shared_ptr<const solvers::Law> neo_hookean(double shear_modulus, double poisson_ratio) {
  return solvers::make_law(
      {solvers::NeoHookeanLaw{shear_modulus}, solvers::bulk_modulus_of(shear_modulus, poisson_ratio), {}});
}

Vector3 face_force(const solvers::FiniteBody& body, const std::vector<Vector3>& constraint_forces, int axis,
                   double coordinate) {
  Vector3 sum = Vector3::Zero();
  for (std::size_t e = 0; e < constraint_forces.size(); ++e) {
    if (std::abs(body.held().means()[e].centroid[axis] - coordinate) < 1e-9)
      sum += constraint_forces[e];
  }
  return sum;
}

double nodal_error(const solvers::FiniteBody& body, const VectorX& coefficients,
                   const std::function<Vector3(const Vector3& x)>& exact) {
  const VectorX displacement = body.nodal_displacements(coefficients);
  double error = 0, size = 0;
  for (int i = 0; i < body.size(); ++i) {
    const Vector3 wanted = exact(body.problem().nodes.positions[i]);
    error += (displacement.segment<3>(3 * i) - wanted).squaredNorm();
    size += wanted.squaredNorm();
  }
  return std::sqrt(error / size);
}

double gradient_error(const solvers::FiniteBody& body, const VectorX& coefficients, const Matrix3& exact) {
  double error = 0;
  for (const Vector3& x : body.problem().nodes.positions)
    error = std::max(error, (body.at(x, coefficients).deformation - exact).norm());
  return error / (exact - Matrix3::Identity()).norm();
}

} // namespace spherecut::experiments
