// How often a client sends its pose, and a way from pose to pose for a loop that asks more often. No sockets here.
#pragma once

#include "src/haptics/device.hpp"

#include <array>
#include <atomic>

namespace spherecut::app {

/// What a client's rate makes of its force.
enum class PaceKind : std::uint8_t {
  unknown,      // it has only begun
  full,         // of every tick there is a pose
  interpolated, // the loop's pose follows the client's, late by its time between two of them, two ticks at least
  too_slow,     // the force fades: below slowest_client nothing keeps the hand from swinging
};

inline constexpr double slowest_client = 50; // poses a second

/// A client's rate, as other threads may see it.
struct PaceReading {
  PaceKind kind = PaceKind::unknown;
  double rate = 0; // poses a second
};

/// What a session's clients sent.
struct PaceCounters {
  double rate = 0;                           // poses a second of the last client, as measured last; 0: not known
  double slowest = 0;                        // the least that was measured
  std::uint64_t interpolated = 0, faded = 0; // ticks with a pose on its way, with a client too slow for a force
};

/// Neither allocates, locks nor throws.
///
/// The rate is that of the poses of the last half second, at most 64. Below three quarters of the loop's the tool goes
/// from where it is to each new pose in the mean time between two of them, evenly: the force has no steps then, and is
/// as late as that. So it does, over two ticks, where a client of the loop's rate sends unevenly: one tick in
/// sixteen or more had no pose, at some time within the last second. A pose that no hand could have reached
/// (fastest_hand) is taken at once.
class ClientPace {
 public:
  /// `rate`: ticks per second.
  explicit ClientPace(double rate) : rate_(rate) {}
  /// Somebody else sends from now on.
  void begin() noexcept;
  /// The newest pose has come, at this tick.
  void take(const Vector3& position, const Eigen::Quaterniond& orientation, std::uint64_t tick) noexcept;
  /// Fills in the pose of a tick and what DeviceState::client says. Once a tick, after take().
  void lead(DeviceState& state) noexcept;

  /// Poses a second; 0: not known yet.
  [[nodiscard]] double measured() const { return measured_; }
  [[nodiscard]] PaceKind kind() const { return kind_; }

 private:
  void measure(std::uint64_t tick) noexcept;

  static constexpr std::size_t window = 64;
  double rate_;
  std::array<std::uint64_t, window> arrivals_{}; // ticks, a ring
  std::size_t count_ = 0;                        // of all arrivals of this client
  double measured_ = 0;
  PaceKind kind_ = PaceKind::unknown;
  bool fresh_ = false, leads_ = false;
  PathPose from_, to_, at_;             // of the way at hand; where the loop has the tool
  std::uint64_t began_ = 0, taken_ = 0; // ticks: of the way, of the newest pose
  std::uint64_t uneven_until_ = 0;      // tick
  double length_ = 1;                   // of the way, ticks
  double share_ = 1;
};

/// Counts what ClientPace finds, and shows the newest of it to other threads.
class PaceWatch {
 public:
  /// Once a tick, after ClientPace::lead().
  void count(const ClientPace& pace, const DeviceState& state, PaceCounters& counters) noexcept;
  /// Nobody sends any more.
  void forget() noexcept { kind_.store(PaceKind::unknown, std::memory_order_relaxed); }
  /// From any thread.
  [[nodiscard]] PaceReading shown() const noexcept {
    return {kind_.load(std::memory_order_relaxed), rate_.load(std::memory_order_relaxed)};
  }

 private:
  std::atomic<PaceKind> kind_{PaceKind::unknown};
  std::atomic<double> rate_{0};
  static_assert(std::atomic<double>::is_always_lock_free && std::atomic<PaceKind>::is_always_lock_free);
};

} // namespace spherecut::app
