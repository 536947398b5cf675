// What the first steps of a run would be refused for, told before anything is computed or written.
#pragma once

#include "src/tissue/state.hpp"

namespace spherecut::app {

/// Of a session that has its first nodes. Throws InputError with the line where what is held leaves the organ a rigid
/// motion, where the path leads the tool onto held surface alone, or closes a grasper on it.
void require_first_steps(const SessionState& state);

} // namespace spherecut::app
