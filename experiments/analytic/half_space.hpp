// Exact contacts of a rigid tool with an elastic half-space. Depths count into the body; r is the distance from the
// axis of the tool. The far field of each is that of solvers::half_space_displacement.
#pragma once

#include "solvers/elasticity/material.hpp"

namespace spherecut::experiments {

/// Force (N) on a frictionless flat punch of radius a (m) at depth d (m), 2 E a d / (1 - nu^2) [Sneddon 1965].
double flat_punch_force(const solvers::Material& material, double radius, double depth);

/// Depth (m) of the surface at r under and beside the frictionless flat punch; infinite slope just outside the edge.
double flat_punch_profile(double radius, double depth, double r);

/// Pressure (Pa) under the frictionless flat punch, r < radius; infinite at the edge.
double flat_punch_pressure(const solvers::Material& material, double radius, double depth, double r);

/// Force of a flat punch bonded to the surface, relative to the frictionless one:
/// (1 - nu) ln(3 - 4 nu) / (1 - 2 nu) [Mossakovskii 1954; Spence 1968]. Takes 0 <= nu <= 1/2; 1 at 1/2.
double bonded_punch_factor(double poisson_ratio);

/// Frictionless contact of a rigid sphere [Hertz 1882; Johnson 1985, chapter 4].
struct HertzContact {
  double force = 0;         // N, (4/3) E/(1 - nu^2) sqrt(R) d^(3/2)
  double radius = 0;        // m, of the contact: sqrt(R d)
  double peak_pressure = 0; // Pa; p(r) = peak sqrt(1 - (r/radius)^2)
};
HertzContact hertz_contact(const solvers::Material& material, double sphere_radius, double depth);

/// Depth (m) of the surface at r under and beside the sphere.
double hertz_profile(double sphere_radius, double depth, double r);

} // namespace spherecut::experiments
