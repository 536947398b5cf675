// The grasper of a session whose law is not linear.
#pragma once

#include "src/tissue/grasping.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// Takes hold of the tissue or lets go of it where the time has come; the step that follows is solved with that. Throws
/// NumericalError, and InputError when there is nothing to hold. True: it has let go.
bool follow_grip(const StepSample& sample, SessionState& state, Grasping& grasping);

} // namespace spherecut::app
