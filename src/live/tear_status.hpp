// What the tears of a session are at, and why they go no further.
#pragma once

#include "src/session/session.hpp"

namespace spherecut::app {

enum class TearState : std::uint8_t {
  none,     // nothing tears in this scenario, or nothing is solved yet
  intact,   // nothing has torn
  growing,  // by an increment in the last solve
  unstable, // likewise, by itself: it is released as much or more at every increment
  arrested, // it has come to rest
  refused,  // its next increment could not be made
  severed,  // it has parted the body
};
std::string_view to_string(TearState state);

struct TearStatus {
  TearState state = TearState::none;
  std::string reason; // why it does not grow
  double area = 0;    // m2 torn
};

/// After a step whose status before was `before`. A body that a tear has parted stays severed until a tear grows again.
TearStatus tear_status(const StepResult& result, const TearStatus& before);

} // namespace spherecut::app
