// What the parts of BladeForce share: where its edge meets the body (blade_meeting.cpp), how it goes on and cuts
// (blade_force.cpp), and what it tells (blade_report.cpp).
#pragma once

#include "src/blade/force.hpp"

namespace spherecut::app {

inline constexpr double first_trigger = 1.2;            // of the needed release, at which a first cut is proposed
inline constexpr double first_wait = 2 * first_trigger; // the same, past which the blade waits for a first cut
inline constexpr double least_increment = 0.2;          // of the node spacing: no later cut is shorter, but where the
                                                        // edge gives way by less than half of that
inline constexpr double same_pose = 1e-6;               // of the way from one pose to the next: no other pose

/// Of a place in the body as it is: negative inside; outside where there is no telling.
double signed_distance(const topology::Domain& domain, const topology::RestMap& to_rest, const Vector3& x);

/// The body under its loads and its tool: lips that the blade brings together are in its own contact.
solvers::Field without_lips(const BodyModel& body);

} // namespace spherecut::app
