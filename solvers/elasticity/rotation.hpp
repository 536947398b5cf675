// The rotation of a deformation.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

/// R of the polar decomposition F = R U; where det F < 0 the rotation nearest to F.
Matrix3 rotation_of(const Matrix3& deformation);

/// Halfway from the rotation of one deformation to that of another.
Matrix3 rotation_between(const Matrix3& one, const Matrix3& other);

/// Angle of that rotation, degrees.
double rotation_degrees(const Matrix3& deformation);

} // namespace spherecut::solvers
