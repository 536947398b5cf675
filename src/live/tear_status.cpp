#include "src/live/tear_status.hpp"

namespace spherecut::app {

std::string_view to_string(TearState state) {
  switch (state) {
  case TearState::none:
    break;
  case TearState::intact:
    return "intact";
  case TearState::growing:
    return "growing";
  case TearState::unstable:
    return "unstable";
  case TearState::arrested:
    return "arrested";
  case TearState::refused:
    return "refused";
  case TearState::severed:
    return "severed";
  }
  return "none";
}

TearStatus tear_status(const StepResult& result, const TearStatus& before) {
  if (!result.tear)
    return before;
  static constexpr std::string_view refusal = "refused: ";
  const TearReport& report = *result.tear;
  TearStatus now{TearState::intact, report.reason, report.area};
  const bool refused = now.reason.rfind(refusal, 0) == 0;
  if (refused)
    now.reason.erase(0, refusal.size());
  const bool moves = report.increments.size() > 1;
  if (report.severed || (before.state == TearState::severed && !moves && !refused))
    now.state = TearState::severed;
  else if (moves)
    now.state = report.unstable ? TearState::unstable : TearState::growing;
  else if (refused)
    now.state = TearState::refused;
  else if (report.area > 0)
    now.state = TearState::arrested;
  return now;
}

} // namespace spherecut::app
