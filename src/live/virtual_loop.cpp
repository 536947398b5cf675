#include "src/live/virtual_loop.hpp"

#include "src/live/second_hand.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <deque>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

void check_events(const std::vector<SolveEvent>& events) {
  for (std::size_t i = 0; i < events.size(); ++i) {
    const SolveEvent& event = events[i];
    const bool rises = i == 0 || (event.sequence > events[i - 1].sequence && event.pose_tick > events[i - 1].pose_tick);
    if (!rises || event.arrival_tick < event.pose_tick)
      throw InputError(fmt::format("solve {} at tick {}, arriving at tick {}, is out of order", event.sequence,
                                   event.pose_tick, event.arrival_tick));
  }
}

// Solves that have not arrived yet; snapshots are large and used again.
class InFlight {
 public:
  BothSnapshots& launch(const SolveEvent& event) {
    if (spare_.empty())
      spare_.push_back(std::make_unique<BothSnapshots>());
    flying_.push_back({event, std::move(spare_.back())});
    spare_.pop_back();
    return *flying_.back().snapshot;
  }
  /// The solve launched last never lands.
  void drop() {
    spare_.push_back(std::move(flying_.back().snapshot));
    flying_.pop_back();
  }
  [[nodiscard]] bool due(std::uint64_t tick) const {
    return !flying_.empty() && flying_.front().event.arrival_tick <= tick;
  }
  /// The newest snapshot that is due; it stays until the next one lands.
  const BothSnapshots& land(std::uint64_t tick) {
    while (due(tick)) {
      if (landed_ != nullptr)
        spare_.push_back(std::move(landed_));
      landed_ = std::move(flying_.front().snapshot);
      flying_.pop_front();
    }
    return *landed_;
  }

 private:
  struct Flight {
    SolveEvent event;
    std::unique_ptr<BothSnapshots> snapshot;
  };
  std::deque<Flight> flying_;
  std::unique_ptr<BothSnapshots> landed_;
  std::vector<std::unique_ptr<BothSnapshots>> spare_;
};

Hands hands_of(const TickRecord& tick) {
  Hands hands(tick.device);
  hands.are_two = tick.two_hands;
  if (tick.second)
    hands.second = tick.second->device;
  return hands;
}

} // namespace

TickRecord record_of(const DeviceState& device, const TickResult& result, bool arrived) noexcept {
  TickRecord record;
  record.device = device;
  record.force = result.force;
  record.tissue = result.tissue;
  record.model = result.model.force;
  record.torque = result.torque;
  record.tissue_torque = result.tissue_torque;
  record.energy = result.energy;
  record.depth = result.contact.depth;
  record.sinking = result.model.sinking;
  record.sequence = result.sequence;
  record.arrived = arrived;
  record.limited = result.limited;
  record.softened = result.softened;
  record.outside = result.outside;
  record.converged = result.model.converged;
  record.active = result.model.active;
  record.rounds = result.model.rounds;
  return record;
}

SecondHandRecord second_record_of(const DeviceState& device, const TickResult& result) noexcept {
  return {device, result.force, result.tissue, result.torque, result.tissue_torque, result.energy, result.limited};
}

SolveRecord record_of(const SolveEvent& event, const ContactSnapshot& snapshot) {
  SolveRecord record;
  record.event = event;
  record.resprinkled = snapshot.resprinkled;
  record.cut_triangles = snapshot.cut_triangles;
  record.nodes = snapshot.nodes;
  record.candidates = snapshot.count;
  for (int c = 0; c < snapshot.count; ++c)
    record.active += snapshot.active[c];
  record.topology = snapshot.topology;
  record.asymmetry = snapshot.condensed != nullptr ? snapshot.condensed->asymmetry : 0;
  record.force = snapshot.force;
  record.torque = snapshot.torque;
  record.seconds = snapshot.solve_seconds;
  return record;
}

std::vector<SolveEvent> regular_solves(std::uint64_t ticks, std::uint64_t period, std::uint64_t latency) {
  std::vector<SolveEvent> events;
  if (period == 0)
    throw InputError("a solve every 0 ticks; allowed: 1 or more");
  for (std::uint64_t tick = 0; tick < ticks; tick += period)
    events.push_back({events.size() + 1, tick, tick + latency, 0});
  return events;
}

std::vector<LoopRecords> run_virtual(const std::vector<HapticSettings>& settings, HapticSimulation& simulation,
                                     Device& device, const std::vector<SolveEvent>& events, std::uint64_t ticks,
                                     const VirtualOptions& options) {
  check_events(events);
  const topology::ContactQuery query(simulation.session().organ().domain->surface());
  std::vector<std::unique_ptr<HapticTick>> cores;
  cores.reserve(settings.size());
  for (const HapticSettings& one : settings)
    cores.push_back(
        std::make_unique<HapticTick>(one, simulation.tool(), &query, simulation.session().scenario().tool.has_value()));
  SecondHand second(settings.front(), simulation.tool(), query, options.second);
  if (second.is_there())
    simulation.require_two_hands();
  std::vector<LoopRecords> records(settings.size());
  std::vector<SolveRecord> solves;
  InFlight flights;
  auto next = events.begin();
  const auto run_tick = [&](std::uint64_t tick) {
    const Hands hands = read_hands(device, second.device(), tick);
    const DeviceState& state = hands.first;
    if (tick == 0) {
      simulation.prepare(hands);
      for (const auto& core : cores)
        core->start(state);
    }
    if (next == events.end() || next->pose_tick > tick)
      simulation.pass(hands);
    for (; next != events.end() && next->pose_tick <= tick; ++next) {
      BothSnapshots& snapshots = flights.launch(*next);
      solves.push_back(
          solve_recording(simulation, hands, *next, snapshots.first, second.is_there() ? &snapshots.second : nullptr));
      options.on_solve(solves.back());
      if (solves.back().failed || next->arrival_tick == SolveEvent::never)
        flights.drop();
    }
    const bool arrives = flights.due(tick);
    const BothSnapshots* arrived = arrives ? &flights.land(tick) : nullptr;
    for (std::size_t m = 0; m < cores.size(); ++m) {
      if (arrives)
        cores[m]->arrive(arrived->first);
      const TickResult result = cores[m]->tick(state);
      if (m == 0)
        device.render(result.force, result.torque);
      records[m].ticks.push_back(record_of(state, result, arrives));
    }
    if (arrives)
      second.arrive(arrived->second);
    second.tick(hands, records.front().ticks.back());
    options.on_tick(records.front().ticks.back());
  };
  try {
    for (std::uint64_t tick = 0; tick < ticks && !options.stop(); ++tick)
      run_tick(tick);
  } catch (const Interrupted&) { // the tick at hand is given up, and the solve in it
    if (records.front().ticks.empty())
      throw;
  }
  for (LoopRecords& one : records)
    one.solves = solves;
  return records;
}

LoopRecords run_virtual(const HapticSettings& settings, HapticSimulation& simulation, Device& device,
                        const std::vector<SolveEvent>& events, std::uint64_t ticks, const VirtualOptions& options) {
  return std::move(run_virtual(std::vector{settings}, simulation, device, events, ticks, options).front());
}

std::vector<SolvedForce> solve_recorded(HapticSimulation& simulation, const std::vector<TickRecord>& ticks,
                                        std::uint64_t stride, const std::function<bool()>& stop) {
  std::vector<SolvedForce> forces;
  ContactSnapshot snapshot;
  for (std::size_t i = 0; i < ticks.size() && !(stop && stop()); i += stride) {
    if (i == 0)
      simulation.prepare(hands_of(ticks[0]));
    for (std::size_t k = i < stride ? i : i - stride + 1; k < i; ++k)
      simulation.pass(hands_of(ticks[k]));
    simulation.solve(hands_of(ticks[i]), 0, snapshot);
    forces.push_back({ticks[i].device.tick, snapshot.force, simulation.result().resprinkled, snapshot.cut_triangles,
                      simulation.result().active_nodes, snapshot.torque});
  }
  return forces;
}

} // namespace spherecut::app
