// Where a tear starts without a cut: a strength criterion on the stress averaged over a length.
#pragma once

#include "solvers/body/discretisation.hpp"

namespace spherecut::solvers {

/// Length over which the stress is averaged where none is given, m: 2 E' G_c / (pi strength^2), E' = E / (1 - nu^2),
/// the line method of critical distances [Taylor 2007].
double averaging_length(const Material& material, double toughness, double strength);

/// Radius of the penny crack that strength and toughness together ask for, m: under a tension of `strength` making it
/// releases G_c times its area, 3 pi E' G_c / (8 strength^2) [coupled criterion, Leguillon 2002].
double seed_radius(const Material& material, double toughness, double strength);

/// A principal stress, Pa, and its direction.
struct PrincipalStress {
  double stress = 0;
  Vector3 direction = Vector3::UnitX();
};

/// Largest principal value of the stress averaged over the part of a ball about `x` that is inside the body and seen
/// from x (45 points on three shells; a mean over it depends on the field alone, not on its nodes). Throws InputError
/// when the radius is not positive.
PrincipalStress averaged_stress(const Discretisation& body, const Field& field, const Vector3& x, double radius);

/// The node at which that is largest, among those for which `counts`; -1: it is below `strength` at all of them.
struct WeakPlace {
  int node = -1;
  PrincipalStress stress;
};
WeakPlace weakest_place(const Discretisation& body, const Field& field, double radius, double strength,
                        const std::function<bool(int node)>& counts);

} // namespace spherecut::solvers
