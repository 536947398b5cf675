// From the deformed frame, where tools are, to the rest frame, where cuts are made.
#pragma once

#include "topology/types.hpp"

#include <functional>
#include <optional>
#include <vector>

namespace spherecut::topology {

/// The rest position of the material that is now at x, both m.
using RestMap = std::function<Vector3(const Vector3&)>;

/// Solves rest + displacement(rest) = x from rest = x by fixed-point steps with Broyden's update, which also converges
/// where the displacement gradient exceeds 1 as long as material does not turn inside out. Throws NumericalError, with
/// x and the residual, when it is not below `tolerance` m after `most_steps` evaluations.
Vector3 rest_position(const Vector3& x, const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                      int most_steps = 60);

/// The same by Newton's method from the first of several starts that leads there, for fields so steep that fixed-point
/// steps leave the body: derivatives by differences over `difference` m, steps halved until the residual falls. Nothing
/// when none does.
std::optional<Vector3> rest_position_from(const std::vector<Vector3>& starts, const Vector3& x,
                                          const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                                          double difference);

} // namespace spherecut::topology
