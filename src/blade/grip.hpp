// A blade in the tissue between two solves, as far as its force follows from the last one.
#pragma once

#include "topology/base/types.hpp"

#include <array>
#include <limits>

namespace spherecut::app {

/// While the edge sticks, its force rises by the condensed stiffness of its own contact; it does not pull; and from the
/// force at which the next cut is due it cuts on at that force. The flanks drag on their own. Torques are about the
/// origin of the blade's frame; the edge is one force on a lever, which moves on along its way when the blade turns,
/// too, by `arm` times the angle.
struct BladeGrip {
  int contacts = 0;                 // pieces of the edge that stand against the body; 0: the blade is free
  Vector3 force = Vector3::Zero();  // N, on the blade where it was solved: edge and flanks
  Vector3 torque = Vector3::Zero(); // N m, of that force
  Vector3 along = Vector3::UnitZ(); // unit, the way of the edge; its force is against it
  Vector3 arm = Vector3::Zero();    // m, torque of a newton along that way where the edge is
  double edge = 0;                  // N, of the edge against its way
  double stiffness = 0;             // N/m, by which that rises as the blade goes along its way
  double due = std::numeric_limits<double>::infinity(); // N, of the edge, at which it cuts on
  Vector3 drag = Vector3::Zero();                       // N, of the flanks on the blade as it goes along
  Vector3 drag_torque = Vector3::Zero();                // N m, of that
  double stored = 0;                                    // J, elastic, behind the force
  double release = 0;                                   // J/m2, of the edge's force on the front that it presses
  // Places on the parts of the edge that press, m, from the blade's position: once they are out of the body it is free.
  static constexpr int most_places = 4;
  int places = 0;
  std::array<Vector3, most_places> place{};
  double work = 0, surface = 0; // J, of the blade since the start, and of it on new surface
};

} // namespace spherecut::app
