// Responses of a block that is strained alike everywhere, in closed form up to the free stretches, which Newton's
// method finds. Written with principal stretches, apart from the laws' own code: oracles for it and for bodies made of
// it.
#pragma once

#include "solvers/elasticity/law.hpp"

namespace spherecut::solvers::homogeneous {

/// F and first Piola stress P, Pa. Without shear both are diagonal.
struct State {
  Matrix3 gradient = Matrix3::Identity();
  Matrix3 stress = Matrix3::Zero();
};

/// Principal first Piola stresses, Pa, of F = diag(stretches). Fibres lie so that P is diagonal too: along axes, or two
/// families that mirror each other in two of them. Throws InputError for other fibres and for stretches that are not
/// positive.
Vector3 principal_stress(const LawSpec& spec, const Vector3& stretches);

/// F = diag(stretch, a, b), a and b such that no stress acts along them. All of these throw InputError when the law has
/// no such state (it softens before), or as principal_stress.
State uniaxial(const LawSpec& spec, double stretch);
/// F = diag(stretch, 1, 1).
State confined(const LawSpec& spec, double stretch);
/// F = diag(stretch, stretch, b), no stress along the third axis.
State equibiaxial(const LawSpec& spec, double stretch);
/// F = diag(stretch, 1, b), no stress along the third axis.
State pure_shear(const LawSpec& spec, double stretch);
/// F = I + amount e1 e2^T; any fibres.
State simple_shear(const LawSpec& spec, double amount);

/// Uniaxial stress along `axis` (unit) of a law whatever its fibres: a material line along the axis stays along it and
/// is stretched; the lateral sides are free. By Newton's method with the law's own tangent. Throws InputError as above.
State uniaxial_along(const Law& law, const Vector3& axis, double stretch);

} // namespace spherecut::solvers::homogeneous
