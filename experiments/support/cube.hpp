// The unit cube with irregular nodes, its base held, the other faces loaded: ground of the patch and convergence tests.
#pragma once

#include "experiments/analytic/manufactured.hpp"

namespace spherecut::experiments {

/// (divisions + 1)^3 nodes on a grid, moved at random by up to `jitter` spacings in every direction that keeps them on
/// their face or edge. The base z = 0 has the field's displacement prescribed, the other five faces its traction.
solvers::Problem cube_problem(const ManufacturedField& field, int divisions, double jitter, std::uint64_t seed);

/// Relative L2 error of the nodal displacements against the field.
double displacement_error(const solvers::Discretisation& body, const solvers::Field& solution,
                          const ManufacturedField& field);

} // namespace spherecut::experiments
