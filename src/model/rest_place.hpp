// Where material that is somewhere now was at rest.
#pragma once

#include "src/model/body_model.hpp"
#include "topology/blade/rest_position.hpp"

namespace spherecut::app {

/// Where the material that is now at x, m, was at rest, as the model's solution has it. Outside the body the
/// displacement goes on as at the nearest point of its surface. A place in the opening of a cut, where there is no
/// material, belongs to the sheet. `spacing`: of the nodes, of which tolerances are parts. Answers are kept in the
/// model. Throws NumericalError where the place is not known.
Vector3 rest_position(const Vector3& x, const BodyModel& model, const topology::Domain& domain,
                      const solvers::SpacingField& spacing);

} // namespace spherecut::app
