// What fracture needs to know of material and nodes at a place of the front.
#pragma once

#include "solvers/body/discretisation.hpp"

namespace spherecut::solvers {

/// E / (1 - nu^2), Pa: K^2 over the energy release rate in the first two modes.
double plane_strain_modulus(const Material& material);

/// Spacing of the node nearest to x, m; of two as near, the first.
double spacing_at(const NodeCloud& nodes, const Vector3& x);

} // namespace spherecut::solvers
