// Parts of a box on either side of a plane.
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::solvers {

struct BoxPart {
  double volume = 0;                  // m3
  Vector3 centroid = Vector3::Zero(); // m; meaningless without volume
};

/// The part of the box centre +- half with normal . (x - point) >= 0 (first) and the rest (second): exact volumes and
/// centroids. A part below 1e-9 of the box is given to the other.
std::array<BoxPart, 2> split_box(const Vector3& centre, const Vector3& half, const Vector3& point,
                                 const Vector3& normal);

} // namespace spherecut::solvers
