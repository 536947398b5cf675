// The interaction integral at places of a front where its tube does not fit into the body.
#pragma once

#include "solvers/fracture/stress_intensity.hpp"

namespace spherecut::solvers {

/// As interaction_integral(), over what of the tube lies in the body: the shift fades to nothing within `inset` node
/// spacings of the surface, so that no term is left there, whatever the surface carries and however it lies to the
/// front. Throws InputError when the front is nearer to the surface than a fifth of that, or turns within the tube.
Intensities inset_integral(const Discretisation& body, const Field& field, const topology::FrontFrame& front,
                           double inset, const InteractionOptions& options = {});

/// The same as interaction_rule().
IntensityRule inset_rule(const Discretisation& body, bool with_pressure, const topology::FrontFrame& front,
                         double inset, const InteractionOptions& options = {});

} // namespace spherecut::solvers
