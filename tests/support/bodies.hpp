// Small bodies with nodes for tests of the discretisations.
#pragma once

#include "solvers/body/discretisation.hpp"

#include <Eigen/Geometry>
#include <random>

namespace spherecut::tests {

/// Nodes on a jittered grid in the box, those of faces kept on their faces; the base z = lower.z is held.
inline solvers::Problem held_box(const Vector3& lower, const Vector3& upper, double h, double jitter,
                                 const solvers::Material& material, std::uint64_t seed = 1) {
  solvers::Problem problem;
  problem.domain = topology::make_box_domain(lower, upper, h);
  problem.material = material;
  problem.prescribed_region = [lower](const Vector3& x, const Vector3& normal) {
    return x.z() < lower.z() + 1e-9 && normal.z() < -0.5;
  };
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-jitter * h, jitter * h);
  const std::array<long, 3> divisions{std::lround((upper - lower).x() / h), std::lround((upper - lower).y() / h),
                                      std::lround((upper - lower).z() / h)};
  std::array<long, 3> index{};
  for (index[0] = 0; index[0] <= divisions[0]; ++index[0])
    for (index[1] = 0; index[1] <= divisions[1]; ++index[1])
      for (index[2] = 0; index[2] <= divisions[2]; ++index[2]) {
        Vector3 x, normal = Vector3::Zero();
        int faces = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double move = shift(random);
          const bool low = index[axis] == 0, high = index[axis] == divisions[axis];
          x[axis] = low ? lower[axis] : high ? upper[axis] : lower[axis] + static_cast<double>(index[axis]) * h + move;
          if (low || high) {
            normal[axis] = low ? -1 : 1;
            ++faces;
          }
        }
        const solvers::NodeKind kind = faces == 0   ? solvers::NodeKind::interior
                                       : faces == 1 ? solvers::NodeKind::surface
                                                    : solvers::NodeKind::edge;
        if (faces > 0)
          normal.normalize();
        const int node = problem.nodes.add(x, h, kind, normal);
        if (index[2] == 0)
          problem.prescribed.push_back({node, {true, true, true}, Vector3::Zero()});
      }
  return problem;
}

/// Surface nodes of the top face that are not on its edges.
inline std::vector<int> top_nodes(const solvers::Problem& problem) {
  std::vector<int> nodes;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] == solvers::NodeKind::surface && problem.nodes.normals[i].z() > 0.9)
      nodes.push_back(i);
  return nodes;
}

inline solvers::DiscretisationOptions options_for(solvers::Method method) {
  solvers::DiscretisationOptions options;
  options.method = method;
  return options;
}

} // namespace spherecut::tests
