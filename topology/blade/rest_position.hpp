// From the deformed frame, where tools are, to the rest frame, where cuts are made.
#pragma once

#include "topology/base/types.hpp"

#include <functional>
#include <optional>
#include <vector>

namespace spherecut::topology {

/// The rest position of the material that is now at x, both m.
using RestMap = std::function<Vector3(const Vector3&)>;

/// Where the material that is now at a place was at rest.
struct RestPlace {
  Vector3 position;  // m
  bool exact = true; // below the fine tolerance
};

/// Solves rest + displacement(rest) = x from rest = x by fixed-point steps with Broyden's update, which also converges
/// where the displacement gradient exceeds 1 as long as material does not turn inside out. Where the residual does not
/// fall below `tolerance` m, but was below `coarse_tolerance` m, as where the displacement jumps by a little, it is the
/// first such place. Throws NumericalError, with x and the residual, when there is none after `most_steps` evaluations,
/// or when none of the last twenty has lowered the residual.
RestPlace rest_position(const Vector3& x, const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                        double coarse_tolerance = 0, int most_steps = 60);

/// The same by Newton's method from the first of several starts that leads there, for fields so steep that fixed-point
/// steps leave the body: derivatives by differences over `difference` m, steps halved until the residual falls. Nothing
/// when none does.
std::optional<Vector3> rest_position_from(const std::vector<Vector3>& starts, const Vector3& x,
                                          const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                                          double difference);

} // namespace spherecut::topology
