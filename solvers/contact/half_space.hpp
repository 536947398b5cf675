// Point force on the surface of an elastic half-space: the far field of any tool that touches a large organ.
#pragma once

#include "solvers/elasticity/material.hpp"
#include "topology/base/types.hpp"

namespace spherecut::solvers {

/// Displacement (m) at x of a half-space under a force (N, any direction) on the body at `origin`, a point of its
/// surface [Boussinesq 1885 for the normal part; Cerruti 1882 for the tangential part; Johnson 1985, sections 3.2
/// and 3.6]. `inward_normal` is a unit vector into the body. Falls off as 1 / distance and vanishes at infinity. Points
/// on the surface are allowed. Throws InputError for a bad material, a normal that is not a unit vector, x at the
/// origin (the field is singular there), or x outside the body by more than half its distance from the origin.
Vector3 half_space_displacement(const Material& material, const Vector3& force, const Vector3& origin,
                                const Vector3& inward_normal, const Vector3& x);

} // namespace spherecut::solvers
