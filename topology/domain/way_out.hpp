// How far a body goes on along a line.
#pragma once

#include "topology/domain/domain.hpp"

namespace spherecut::topology {

/// Way from a point in the body or on its surface along a unit direction to where the line leaves the body, m;
/// `longest` where it does not before. Right to 1e-5 of the diagonal of the body.
double way_out(const Domain& domain, const Vector3& from, const Vector3& direction, double longest);

} // namespace spherecut::topology
