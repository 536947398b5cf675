// Inner loops of a body at finite strain: deformation gradients at eight points, and the forces of their stresses.
#pragma once

#include "solvers/finite/point_table.hpp"

namespace spherecut::solvers {

/// F = I + sum_J u_J (x) g_J at the points of a group, entry (i, j) at i + 3 j. `coefficients`: 3 a node, m.
void deformation_gradients(const int* nodes, int count, const LaneValues* gradients, const double* coefficients,
                           LaneValues* deformation);

/// forces[3 k + i] = sum over points and j of stress(i, j) g_kj, `stress` with the weights in it, N.
void group_forces(int count, const LaneValues* gradients, const LaneValues* stress, double* forces);

} // namespace spherecut::solvers
