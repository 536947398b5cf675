// The virtual shift of the material about a front, of which domain integrals take the energy: whole at the front,
// nothing beyond a tube about it.
#pragma once

#include "topology/incision/incision.hpp"

namespace spherecut::solvers {

/// Of the front's radius of curvature: the radius of a tube that may still take the front as an arc.
inline constexpr double widest_turn = 0.9;

struct Faded {
  double value = 0, slope = 0; // slope: 1/m
};

/// Across the front, at a distance r from it: one below `inner`, none above `outer`, m.
Faded faded_across(double r, double inner, double outer);

/// Along it, at s from the middle of a tube of that half length, m: one there, none beyond its ends.
Faded faded_along(double s, double half_length);

struct Cover {
  double share = 1;
  Vector3 gradient = Vector3::Zero(); // 1/m
};

/// What is left of a shift that fades to nothing over the last `inset` m below the surface of the body; 0: all of it.
Cover cover(const topology::Domain& domain, const Vector3& x, double inset);

/// Curvature of the front in the plane of the cut, 1/m, seen over `h` m to both sides: positive where the way ahead
/// fans out.
double front_curvature(const topology::Incision& incision, const topology::FrontFrame& front, double h);

} // namespace spherecut::solvers
