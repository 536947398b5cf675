#include "solvers/fracture/local_values.hpp"

namespace spherecut::solvers {

double plane_strain_modulus(const Material& material) {
  return material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
}

double spacing_at(const NodeCloud& nodes, const Vector3& x) {
  int best = 0;
  for (int i = 1; i < nodes.size(); ++i)
    if ((nodes.positions[i] - x).squaredNorm() < (nodes.positions[best] - x).squaredNorm())
      best = i;
  return nodes.spacings[best];
}

} // namespace spherecut::solvers
