#include "experiments/support/cube.hpp"

#include <algorithm>
#include <random>

namespace spherecut::experiments {

solvers::Problem cube_problem(const ManufacturedField& field, int divisions, double jitter, std::uint64_t seed) {
  const double h = 1.0 / divisions;
  solvers::Problem problem;
  problem.domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), h);
  problem.material = field.material;
  problem.loads = field.loads();
  problem.prescribed_field = [field](const Vector3& x) { return field.displacement(x); };
  problem.prescribed_region = [](const Vector3& x, const Vector3& normal) { return x.z() < 1e-9 && normal.z() < -0.5; };
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-jitter * h, jitter * h);
  for (int a = 0; a <= divisions; ++a)
    for (int b = 0; b <= divisions; ++b)
      for (int c = 0; c <= divisions; ++c) {
        const std::array<int, 3> index{a, b, c};
        Vector3 x, normal = Vector3::Zero();
        int faces = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double move = shift(random);
          const bool low = index[axis] == 0, high = index[axis] == divisions;
          x[axis] = low ? 0 : high ? 1 : index[axis] * h + move;
          if (low || high) {
            normal[axis] = low ? -1 : 1;
            ++faces;
          }
        }
        const solvers::NodeKind kind = faces == 0   ? solvers::NodeKind::interior
                                       : faces == 1 ? solvers::NodeKind::surface
                                                    : solvers::NodeKind::edge;
        const int node = problem.nodes.add(x, h, kind, faces > 0 ? Vector3(normal.normalized()) : Vector3(normal));
        if (c == 0)
          problem.prescribed.push_back({node, {true, true, true}, field.displacement(x)});
      }
  return problem;
}

double displacement_error(const solvers::Discretisation& body, const solvers::Field& solution,
                          const ManufacturedField& field) {
  const VectorX displacement = body.nodal_displacements(solution);
  const solvers::NodeCloud& nodes = body.problem().nodes;
  double error = 0, size = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3 exact = field.displacement(nodes.positions[i]);
    error += (displacement.segment<3>(3 * i) - exact).squaredNorm();
    size += exact.squaredNorm();
  }
  return std::sqrt(error / size);
}

} // namespace spherecut::experiments
