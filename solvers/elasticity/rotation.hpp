// The rotation of a deformation.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

/// R of the polar decomposition F = R U.
Matrix3 rotation_of(const Matrix3& deformation);

/// Angle of that rotation, degrees.
double rotation_degrees(const Matrix3& deformation);

} // namespace spherecut::solvers
