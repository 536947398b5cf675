#include "src/haptics/realtime_loop.hpp"

#include "topology/errors.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <thread>

namespace spherecut::app {
namespace {

constexpr long long second = 1'000'000'000; // ns

long long clock_now(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<long long>(time.tv_sec) * second + time.tv_nsec;
}

void sleep_until(long long due) {
  const timespec time{static_cast<time_t>(due / second), static_cast<long>(due % second)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) != 0) {
  }
}

bool ask_for_fifo() {
  sched_param parameter{};
  parameter.sched_priority = 80;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
}

struct Shared {
  TripleBuffer<DeviceState> poses;
  TripleBuffer<ContactSnapshot> snapshots;
  std::atomic<bool> stop{false}, done{false};
};

// The haptic thread: allocates, locks, throws and logs nothing.
void haptic_thread(const HapticSettings& settings, Device& device, const DeviceState& first, HapticTick& core,
                   Shared& shared, const RealtimeOptions& options, std::vector<TickRecord>& ticks, std::uint64_t& done,
                   RealtimeReport& report) noexcept {
  report.fifo = options.fifo && ask_for_fifo();
  const bool spins = report.fifo && std::thread::hardware_concurrency() > 1;
  const auto period = static_cast<long long>(std::llround(static_cast<double>(second) / settings.rate));
  const auto spin = spins ? static_cast<long long>(options.spin * static_cast<double>(second)) : 0;
  const long long start = clock_now(CLOCK_MONOTONIC) + period;
  for (done = 0; done < ticks.size() && !shared.stop.load(std::memory_order_relaxed); ++done) {
    const long long due = start + static_cast<long long>(done) * period;
    if (due - spin > clock_now(CLOCK_MONOTONIC))
      sleep_until(due - spin);
    long long began = clock_now(CLOCK_MONOTONIC);
    while (began < due)
      began = clock_now(CLOCK_MONOTONIC);
    const long long cpu = clock_now(CLOCK_THREAD_CPUTIME_ID);
    const DeviceState state = done == 0 ? first : device.read(done);
    shared.poses.back() = state;
    shared.poses.publish();
    const bool arrives = shared.snapshots.waiting();
    if (arrives) {
      shared.snapshots.fetch();
      core.arrive(shared.snapshots.front());
    }
    const TickResult result = core.tick(state);
    device.apply(result.force);
    TickRecord& record = ticks[done];
    record = record_of(state, result, arrives);
    record.latency = 1e-9 * static_cast<double>(began - due);
    record.compute = 1e-9 * static_cast<double>(clock_now(CLOCK_THREAD_CPUTIME_ID) - cpu);
    report.haptic_cpu_seconds += record.compute;
    if (clock_now(CLOCK_MONOTONIC) > due + period)
      ++report.overruns;
  }
  shared.done.store(true, std::memory_order_release);
}

void simulation_thread(const HapticSettings& settings, HapticSimulation& simulation, Shared& shared, ViewerFeed& feed,
                       std::vector<SolveRecord>& solves, RealtimeReport& report) {
  DegradationRule rule(settings.budget);
  std::uint64_t sequence = 0;
  while (!shared.done.load(std::memory_order_acquire)) {
    if (!shared.poses.fetch()) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      continue;
    }
    const DeviceState state = shared.poses.front();
    const SolveEvent event{++sequence, state.tick, SolveEvent::never, rule.level()};
    ContactSnapshot& snapshot = shared.snapshots.back();
    const long long began = clock_now(CLOCK_MONOTONIC);
    const auto fail = [&](const std::exception& error) {
      solves.push_back({.event = event, .failed = true, .reason = error.what()});
    };
    try {
      simulation.solve(state, event.degradation, snapshot);
    } catch (const NumericalError& error) {
      fail(error);
      continue;
    } catch (const InputError& error) {
      fail(error);
      continue;
    }
    snapshot.sequence = sequence;
    solves.push_back(record_of(event, snapshot));
    if (snapshot.resprinkled || snapshot.cut_triangles > 0)
      rule.rebuilt(snapshot.solve_seconds);
    feed.offer(simulation, snapshot);
    shared.snapshots.publish();
    report.solve_seconds += 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - began);
  }
}

} // namespace

LoopRecords run_realtime(const HapticSettings& settings, HapticSimulation& simulation, Device& device, double duration,
                         const RealtimeOptions& options, RealtimeReport& report) {
  const double count = std::round(duration * settings.rate);
  if (!(count >= 1) || count > 1e8)
    throw InputError(fmt::format("a haptic session of {:g} s at {:g} ticks per second; allowed: 1 to 1e8 ticks",
                                 duration, settings.rate));
  const long long before = clock_now(CLOCK_MONOTONIC);
  LoopRecords records;
  records.ticks.resize(static_cast<std::size_t>(count));
  const Session& session = simulation.session();
  const topology::ContactQuery query(session.organ().domain->surface());
  HapticTick core(settings, simulation.tool(), session.scenario().tool ? &query : nullptr);
  const DeviceState first = device.read(0);
  simulation.prepare(first);
  core.start(first);
  auto shared = std::make_unique<Shared>();
  ViewerFeed feed(settings.viewer_rate);
  report.prepare_seconds = 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - before);

  const long long start = clock_now(CLOCK_MONOTONIC);
  std::uint64_t done = 0;
  std::thread solver([&] { simulation_thread(settings, simulation, *shared, feed, records.solves, report); });
  std::thread haptic(
      [&] { haptic_thread(settings, device, first, core, *shared, options, records.ticks, done, report); });
  while (!shared->done.load(std::memory_order_acquire)) {
    if (feed.fetch())
      options.view(feed.frame());
    if (options.stop())
      shared->stop.store(true, std::memory_order_relaxed);
    std::this_thread::sleep_for(std::chrono::milliseconds(8));
  }
  haptic.join();
  solver.join();
  report.seconds = 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - start);
  report.stopped = done < records.ticks.size();
  report.frames = feed.frames();
  report.viewer_seconds = feed.seconds();
  records.ticks.resize(done);
  for (const TickRecord& tick : records.ticks)
    if (tick.arrived && tick.sequence > 0 && tick.sequence <= records.solves.size())
      records.solves[tick.sequence - 1].event.arrival_tick = tick.device.tick;
  return records;
}

} // namespace spherecut::app
