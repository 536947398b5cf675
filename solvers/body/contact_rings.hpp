// Node rings about the edge of a contact whose radius is known beforehand: a flat punch or a bonded cap.
#pragma once

#include "solvers/body/discretisation.hpp"

namespace spherecut::solvers {

/// Distance of the rings from the contact edge, in units of the spacing there. One constant per method, from the flat
/// punch: 0.25 for `galerkin` (shares of the surface meet at the edge), 0.4 for the others (the cells' forces sit at
/// the nodes).
double contact_ring_offset(Method method);

/// Seed nodes on the surface: one at `centre`, one ring inside and one outside the circle of the given radius about the
/// axis through `centre` along `normal`, both with steps of about `spacing` (m) and staggered. Points of the rings are
/// moved along the axis onto the surface, so that their distance from the axis is exact. Throws InputError for
/// non-positive sizes or when the surface does not meet a ring.
std::vector<SeedNode> contact_rings(const topology::Domain& domain, const Vector3& centre, const Vector3& normal,
                                    double radius, double spacing, double offset);

/// Spacing field that is fine at the edge of such a contact and grows away from it: centres along the circle.
SpacingField edge_spacing(const Vector3& centre, const Vector3& normal, double radius, double fine, double coarse,
                          double slope);

} // namespace spherecut::solvers
