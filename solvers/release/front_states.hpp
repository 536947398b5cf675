// What drives the front of a cut at finite strain: its release rate by the domain integral, its modes by the jump of
// the displacement behind it.
//
// Both are told as intensities, those of the small-strain field that releases as much in the same modes: so averages
// along the front, direction and motion are those of the linear case, to which all of this goes over as the strain
// becomes small. The jump is taken in axes that turn with the tissue at the front,
//
//   d = R^T (n + u+ - u-) - n,   n from one face to the other at rest, R halfway between the rotations of F- and F+,
//
// because a flap that is folded back would otherwise seem to slide. Places without room for the integral, and those
// behind which faces press on one another, have the intensities of that jump by the constants of small strain.
#pragma once

#include "solvers/fracture/tearing.hpp"
#include "solvers/release/energy_release.hpp"

namespace spherecut::solvers {

/// As front_states() of a linear body, `spacing` and `closed` as there. `fibres`: as the body was given them. Throws as
/// that does, and as EnergyMomentum.
std::vector<FrontState> front_states(const FiniteBody& body, const VectorX& coefficients,
                                     const std::function<double(const Vector3&)>& toughness, double spacing,
                                     const std::vector<Vector3>& closed = {},
                                     const std::function<FibreFrame(const Vector3& x)>& fibres = nullptr);

} // namespace spherecut::solvers
