// The parts of a session up to its body, without the session.
#pragma once

#include "src/session/setting_out.hpp"
#include "tests/src/scenario_session.hpp"

namespace spherecut::tests {

struct TissueParts {
  explicit TissueParts(const std::string& text)
      : state(
            scenario_of(text), [](const std::string&) {}, app::Leader::path) {
    app::set_out(state, app::Leader::path);
    app::lay_first_nodes(state, updater);
  }

  app::SessionState state;
  app::BladeTrack blade{state.scenario};
  app::Grasping grasping{state.scenario, *state.organ.domain};
  app::BackgroundBodies background;
  app::ContactSolver contact{state, grasping, blade, background};
  app::BodyUpdater updater{state, contact, grasping, background};
};

} // namespace spherecut::tests
