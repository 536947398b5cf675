#include "solvers/contact/tangential_force.hpp"

#include "solvers/contact/friction.hpp"

namespace spherecut::solvers {

Vector3 tangential_force(const ContactPatch& patch, const ContactState& state, ContactCondition condition) {
  Vector3 force = Vector3::Zero();
  if (condition == ContactCondition::frictional)
    for (const Vector3& along : state.along)
      force -= along;
  if (condition == ContactCondition::bonded)
    for (std::size_t c = 0; c < state.nodal_forces.size(); ++c)
      force -= along_surface(state.nodal_forces[c], patch.normals[c]);
  return force;
}

} // namespace spherecut::solvers
