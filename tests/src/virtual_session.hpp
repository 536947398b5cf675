// Sessions in virtual time: that must come out the same twice, that tear.
#pragma once

#include "src/live/virtual_loop.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

namespace spherecut::tests {

/// Solves at regular ticks that follow tool and cut in the background; every third takes over what has been made there.
inline std::vector<app::SolveEvent> solves_in_background(std::uint64_t ticks, std::uint64_t period,
                                                         std::uint64_t delay) {
  std::vector<app::SolveEvent> events = app::regular_solves(ticks, period, delay);
  for (std::size_t i = 0; i < events.size(); ++i) {
    events[i].in_background = true;
    events[i].swaps = i % 3 == 2;
  }
  return events;
}

/// A scripted session, run twice with the same bits in every solve and tick, and none that fails.
inline app::LoopRecords run_twice(const app::Scenario& scenario, const std::vector<app::SolveEvent>& events,
                                  std::uint64_t ticks) {
  const auto run = [&] {
    const app::HapticSettings settings;
    app::HapticSimulation simulation(scenario);
    app::ScriptedPath device(simulation.path(), settings.rate);
    return app::run_virtual(settings, simulation, device, events, ticks);
  };
  app::LoopRecords first = run();
  const app::LoopRecords second = run();
  REQUIRE(first.solves.size() == events.size());
  REQUIRE(second.solves.size() == events.size());
  for (std::size_t i = 0; i < events.size(); ++i) {
    const app::SolveRecord &a = first.solves[i], &b = second.solves[i];
    CHECK_FALSE(a.failed);
    CHECK(a.event.swaps == events[i].swaps);
    CHECK(a.topology == b.topology);
    CHECK(a.cut_area == b.cut_area);
    CHECK(a.residual == b.residual);
    CHECK(a.update == b.update);
    CHECK(a.force == b.force);
    CHECK(a.torque == b.torque);
  }
  REQUIRE(first.ticks.size() == ticks);
  REQUIRE(second.ticks.size() == ticks);
  bool same = true;
  for (std::size_t i = 0; i < first.ticks.size(); ++i)
    same = same && first.ticks[i].force == second.ticks[i].force && first.ticks[i].torque == second.ticks[i].torque;
  CHECK(same);
  return first;
}

/// What a scripted session has torn, solved every 100 ticks, its force neither limited nor watched.
struct TearingLoop {
  int tearing = 0;           // solves
  double peak = 0, jump = 0; // N, of the tissue's force; from tick to tick
};

inline TearingLoop tear_in_loop(const app::Scenario& scenario, std::uint64_t ticks) {
  app::HapticSettings settings;
  settings.passivity = false;
  settings.limits.force = settings.limits.slew = 1e6;
  app::HapticSimulation simulation(scenario);
  app::ScriptedPath device(simulation.path(), settings.rate);
  const app::LoopRecords records =
      app::run_virtual(settings, simulation, device, app::regular_solves(ticks, 100, 50), ticks);
  TearingLoop loop;
  for (const app::SolveRecord& solve : records.solves) {
    INFO(solve.reason);
    CHECK_FALSE(solve.failed);
    loop.tearing += solve.cut_triangles > 0 ? 1 : 0;
  }
  for (std::size_t k = 1; k < records.ticks.size(); ++k) {
    loop.peak = std::max(loop.peak, records.ticks[k].tissue.norm());
    if (records.ticks[k - 1].sequence > 0)
      loop.jump = std::max(loop.jump, (records.ticks[k].tissue - records.ticks[k - 1].tissue).norm());
  }
  return loop;
}

} // namespace spherecut::tests
