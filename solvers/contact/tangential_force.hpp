// The force on a tool in two parts: what presses, and what acts along the surface.
#pragma once

#include "solvers/contact/solver.hpp"

namespace spherecut::solvers {

/// The part of the force on the tool that acts along the surface, N; the rest of `tool_force` presses. Frictionless:
/// none. Frictional: along the tool's surface. Bonded, and of prescribed displacements: along the body's surface at
/// rest.
Vector3 tangential_force(const ContactPatch& patch, const ContactState& state, ContactCondition condition);

} // namespace spherecut::solvers
