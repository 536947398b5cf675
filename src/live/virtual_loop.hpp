// The haptic loop in virtual time: one thread, no clock, the same bits every time. For experiments, tests and replay.
#pragma once

#include "src/haptics/loop_records.hpp"
#include "src/live/simulation.hpp"

#include <functional>

namespace spherecut::app {

/// Solves that begin every `period` ticks, at the pose of that tick, and are taken over `latency` ticks later.
std::vector<SolveEvent> regular_solves(std::uint64_t ticks, std::uint64_t period, std::uint64_t latency);

/// Who else wants to know, and when to end.
struct VirtualOptions {
  Device* second = nullptr;                          // of a second hand, which has the blade; null: there is none
  std::function<bool()> stop = [] { return false; }; // asked at every tick
  std::function<void(const TickRecord&)> on_tick = [](const TickRecord&) {};
  std::function<void(const SolveRecord&)> on_solve = [](const SolveRecord&) {}; // before the ticks that use it
};

/// Runs `ticks` ticks: reads the devices, solves where an event begins, takes over what arrives, computes the forces
/// and applies them. Events must be in the order of their sequence, pose and arrival ticks rising; a solve that no tick
/// took over is solved all the same. `device` is read from tick 0 on; `simulation` is prepared there. Throws InputError
/// when the events are out of order. A solve that fails is in its record, and the loop goes on.
LoopRecords run_virtual(const HapticSettings& settings, HapticSimulation& simulation, Device& device,
                        const std::vector<SolveEvent>& events, std::uint64_t ticks, const VirtualOptions& options = {});

/// The same for several settings beside one another on the same solves; the device feels the first, and `options` is
/// told of that one.
std::vector<LoopRecords> run_virtual(const std::vector<HapticSettings>& settings, HapticSimulation& simulation,
                                     Device& device, const std::vector<SolveEvent>& events, std::uint64_t ticks,
                                     const VirtualOptions& options = {});

/// Force on the tool solved at every `stride`-th recorded pose in order, by a simulation that has not moved yet: what
/// the force models are judged by.
struct SolvedForce {
  std::uint64_t tick = 0;
  Vector3 force = Vector3::Zero(); // N
  bool resprinkled = false;
  int cut_triangles = 0, active = 0;
  Vector3 torque = Vector3::Zero(); // N m, likewise, about the tool's point
};
/// Ends early, with what it has, once `stop` (may be null) says so.
std::vector<SolvedForce> solve_recorded(HapticSimulation& simulation, const std::vector<TickRecord>& ticks,
                                        std::uint64_t stride, const std::function<bool()>& stop = nullptr);

} // namespace spherecut::app
