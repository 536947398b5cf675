// Shares of the held surface for a body at finite strain. The constraint of a share exerts one traction on all of it,
// so no share may go round an edge: then a constant stress, whose traction is another on each side, is met exactly.
#pragma once

#include "solvers/body/surface_patches.hpp"

namespace spherecut::solvers {

/// Means over the parts of Problem::prescribed_region that belong to the prescribed entries, one each. A node on an
/// edge keeps the side of which its share has most, and the nearest other nodes of the other sides take what is left of
/// them. Without a region: the displacements of the nodes. Throws NumericalError where no sound support covers the
/// surface.
std::vector<DisplacementMean> held_shares(const Problem& problem, const Spheres& spheres,
                                          const SurfacePatches& patches);

} // namespace spherecut::solvers
