#include "src/live/realtime_loop.hpp"

#include "src/haptics/ring.hpp"
#include "src/live/second_hand.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>
#include <fmt/format.h>
#include <optional>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <thread>

namespace spherecut::app {
namespace {

constexpr long long second = 1'000'000'000; // ns
// At most so many a second while a body is made beside them, which may have no other core: it is wanted sooner than
// more solves of the one that is there.
constexpr int solves_beside = 200;

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

constexpr std::size_t solve_slots = 1U << 14U; // waiting for the viewer's thread

struct Shared {
  explicit Shared(double rate)
      : way(static_cast<std::size_t>(std::ceil(ring_seconds * rate))), ticks(way.slots()), solves(solve_slots) {}
  TripleBuffer<Hands> poses;
  Ring<Hands> way; // the same, every one of them, written before
  TripleBuffer<BothSnapshots> snapshots;
  Ring<TickRecord> ticks;   // haptic thread to viewer
  Ring<SolveRecord> solves; // simulation thread to viewer
  std::atomic<bool> stop{false}, done{false};
  std::string failure; // of the simulation thread, which has ended by it; empty: none
};

bool at_rest(const DeviceState& a, const DeviceState& b) {
  return a.position == b.position && a.orientation.coeffs() == b.orientation.coeffs() && a.mode == b.mode &&
         a.buttons == b.buttons;
}

bool at_rest(const Hands& a, const Hands& b) {
  return at_rest(a.first, b.first) && a.second.has_value() == b.second.has_value() &&
         (!a.second || at_rest(*a.second, *b.second));
}

// The haptic thread: allocates, locks, throws and logs nothing.
void haptic_thread(const HapticSettings& settings, Device& device, const Hands& first, HapticTick& core,
                   SecondHand& other, Shared& shared, const RealtimeOptions& options, std::uint64_t count,
                   RealtimeReport& report) noexcept {
  pthread_setname_np(pthread_self(), "haptic"); // so that a profiler finds it
  report.fifo = options.fifo && ask_for_fifo();
  const bool spins = report.fifo && std::thread::hardware_concurrency() > 1;
  const auto period = static_cast<long long>(std::llround(static_cast<double>(second) / settings.rate));
  const auto spin = spins ? static_cast<long long>(options.spin * static_cast<double>(second)) : 0;
  const long long start = clock_now(CLOCK_MONOTONIC) + period;
  TickRecord record;
  std::uint64_t tick = 0;
  std::uint64_t lost = 0;
  for (; tick < count && !shared.stop.load(std::memory_order_relaxed); ++tick) {
    const long long due = start + static_cast<long long>(tick) * period;
    if (due - spin > clock_now(CLOCK_MONOTONIC)) {
      sleep_until(due - spin);
      // While it slept others have had its core: what the tick reads comes back while it waits.
      if (spins && due - spin / 2 > clock_now(CLOCK_MONOTONIC))
        core.fetch();
    }
    long long began = clock_now(CLOCK_MONOTONIC);
    while (began < due)
      began = clock_now(CLOCK_MONOTONIC);
    const long long cpu = clock_now(CLOCK_THREAD_CPUTIME_ID);
    const Hands hands = tick == 0 ? first : read_hands(device, other.device(), tick);
    const DeviceState& state = hands.first;
    lost += shared.way.push(hands) ? 0 : 1;
    shared.poses.back() = hands;
    shared.poses.publish();
    const bool arrives = shared.snapshots.waiting();
    if (arrives) {
      shared.snapshots.fetch();
      core.arrive(shared.snapshots.front().first);
      other.arrive(shared.snapshots.front().second);
    }
    const TickResult result = core.tick(state);
    device.render(result.force, result.torque);
    record = record_of(state, result, arrives);
    other.tick(hands, record);
    record.latency = 1e-9 * static_cast<double>(began - due);
    record.compute = 1e-9 * static_cast<double>(clock_now(CLOCK_THREAD_CPUTIME_ID) - cpu);
    lost += shared.ticks.push(record) ? 0 : 1;
    report.haptic_cpu_seconds += record.compute;
    if (clock_now(CLOCK_MONOTONIC) > due + period)
      ++report.overruns;
  }
  report.ticks = tick;
  report.lost += lost;
  shared.done.store(true, std::memory_order_release);
}

void solve_on(const HapticSettings& settings, HapticSimulation& simulation, Shared& shared, ViewerFeed& feed,
              const RealtimeOptions& options, std::uint64_t& lost, RealtimeReport& report) {
  if (options.niceness > 0)
    static_cast<void>(setpriority(PRIO_PROCESS, 0, options.niceness)); // of this thread alone
  DegradationRule rule(settings.budget);
  std::uint64_t sequence = 0;
  std::optional<Hands> solved; // the last that was
  bool tearing = false;        // in that
  const auto interval = options.most_solves > 0 ? static_cast<long long>(second / options.most_solves) : 0; // ns
  long long next = 0;                                                                                       // solve
  const Session& session = simulation.session();
  const bool in_background = options.follow_in_background || session.scenario().blade;
  while (!shared.done.load(std::memory_order_acquire)) {
    if (!shared.poses.fetch()) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      continue;
    }
    const Hands hands = shared.poses.front();
    for (; shared.way.waiting() > 0 && shared.way.front().first.tick < hands.first.tick; shared.way.pop())
      simulation.pass(shared.way.front());
    if (!options.solve_at_rest && !tearing && solved && at_rest(hands, *solved) && !simulation.body_is_there() &&
        !simulation.has_put_off()) {
      feed.offer_again(simulation);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      continue;
    }
    const long long began = clock_now(CLOCK_MONOTONIC);
    if (solved && began < next) {
      feed.offer_again(simulation);
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(next - began, second / 1000)));
      continue;
    }
    next = began + (session.pending().under_way ? std::max(interval, second / solves_beside) : interval);
    solved = hands;
    const SolveEvent event{++sequence,   hands.first.tick,           SolveEvent::never,
                           rule.level(), simulation.body_is_there(), in_background};
    BothSnapshots& snapshots = shared.snapshots.back();
    const SolveRecord record = solve_recording(simulation, hands, event, snapshots.first,
                                               options.second != nullptr ? &snapshots.second : nullptr);
    lost += shared.solves.push(record) ? 0 : 1;
    tearing = !record.failed && simulation.tearing();
    if (record.failed)
      continue;
    shared.snapshots.publish();
    rule.solved(simulation.result().rebuild, record.seconds);
    feed.offer(simulation, record);
    report.solve_seconds += 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - began);
  }
}

void simulation_thread(const HapticSettings& settings, HapticSimulation& simulation, Shared& shared, ViewerFeed& feed,
                       const RealtimeOptions& options, std::uint64_t& lost, RealtimeReport& report) {
  pthread_setname_np(pthread_self(), "simulation");
  try {
    solve_on(settings, simulation, shared, feed, options, lost, report);
  } catch (const Interrupted&) { // the program ends: the solve at hand is given up, as if it had never been begun
  } catch (const std::exception& error) {
    shared.failure = error.what();
    shared.stop.store(true, std::memory_order_release);
  }
}

// The viewer's thread: what the others leave behind.
class Collector {
 public:
  Collector(Shared& shared, const RealtimeOptions& options, LoopRecords& records)
      : shared_(shared), options_(options), records_(records) {}

  void collect() {
    // A tick that waits now uses a solve that waits by now: those go first.
    const std::size_t ticks = shared_.ticks.waiting();
    for (; shared_.solves.waiting() > 0; shared_.solves.pop())
      take(shared_.solves.front());
    for (std::size_t i = 0; i < ticks; ++i, shared_.ticks.pop())
      take(shared_.ticks.front());
  }

 private:
  void take(SolveRecord& solve) {
    options_.on_solve(solve);
    if (options_.keep)
      records_.solves.push_back(std::move(solve));
  }
  void take(const TickRecord& tick) {
    options_.on_tick(tick);
    if (!options_.keep)
      return;
    records_.ticks.push_back(tick);
    if (!tick.arrived)
      return;
    for (; arrived_ < records_.solves.size() && records_.solves[arrived_].event.sequence <= tick.sequence; ++arrived_)
      if (records_.solves[arrived_].event.sequence == tick.sequence)
        records_.solves[arrived_].event.arrival_tick = tick.device.tick;
  }

  Shared& shared_;
  const RealtimeOptions& options_;
  LoopRecords& records_;
  std::size_t arrived_ = 0; // solves before this one have arrived or never will
};

} // namespace

LoopRecords run_realtime(const HapticSettings& settings, HapticSimulation& simulation, Device& device, double duration,
                         const RealtimeOptions& options, RealtimeReport& report) {
  const double count = std::round(duration * settings.rate);
  if (!(count >= 1) || (options.keep && count > 1e8))
    throw InputError(fmt::format("a haptic session of {:g} s at {:g} ticks per second; allowed: 1 to 1e8 ticks",
                                 duration, settings.rate));
  const long long before = clock_now(CLOCK_MONOTONIC);
  LoopRecords records;
  const Session& session = simulation.session();
  const topology::ContactQuery query(session.organ().domain->surface());
  HapticTick core(settings, simulation.tool(), &query, session.scenario().tool.has_value());
  SecondHand other(settings, simulation.tool(), query, options.second);
  if (other.is_there())
    simulation.require_two_hands();
  const Hands first = read_hands(device, options.second, 0);
  simulation.prepare(first);
  core.start(first.first);
  auto shared = std::make_unique<Shared>(settings.rate);
  ViewerFeed own(settings.viewer_rate);
  ViewerFeed& feed = options.feed != nullptr ? *options.feed : own;
  report.prepare_seconds = 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - before);
  if (options.stop()) {
    report.stopped = true;
    return records;
  }

  const long long start = clock_now(CLOCK_MONOTONIC);
  const auto ticks = count < 1e18 ? static_cast<std::uint64_t>(count) : ~std::uint64_t{0};
  std::uint64_t lost_solves = 0;
  // Where the second cannot be made the first has to end before its exception goes on.
  std::jthread solver([&, ends = shared.get()](const std::stop_token& token) {
    const std::stop_callback end(token, [ends] { ends->done.store(true, std::memory_order_release); });
    simulation_thread(settings, simulation, *shared, feed, options, lost_solves, report);
  });
  std::thread haptic([&] { haptic_thread(settings, device, first, core, other, *shared, options, ticks, report); });
  Collector collector(*shared, options, records);
  std::exception_ptr failure;
  const auto guarded = [&](const auto& act) {
    try {
      if (!failure)
        act();
    } catch (...) {
      failure = std::current_exception();
      shared->stop.store(true, std::memory_order_relaxed);
    }
  };
  while (!shared->done.load(std::memory_order_acquire)) {
    guarded([&] {
      if (options.feed == nullptr && feed.fetch())
        options.view(feed.frame());
      collector.collect();
      if (options.stop())
        shared->stop.store(true, std::memory_order_relaxed);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(8));
  }
  haptic.join();
  report.seconds = 1e-9 * static_cast<double>(clock_now(CLOCK_MONOTONIC) - start);
  solver.join(); // its last solve may take longer
  guarded([&] { collector.collect(); });
  if (failure)
    std::rethrow_exception(failure);
  if (!shared->failure.empty())
    throw NumericalError("the simulation has ended: " + shared->failure);
  report.stopped = report.ticks < ticks;
  report.lost += lost_solves;
  report.frames = feed.frames();
  report.viewer_seconds = feed.seconds();
  return records;
}

} // namespace spherecut::app
