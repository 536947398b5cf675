// How fast a session goes: ticks, solves and pictures a second, and whether it has just cut.
#pragma once

#include "src/viewer/wire.hpp"

#include <chrono>

namespace spherecut::app {

class RateMeter {
 public:
  /// To be called at every tick of the server. The rates are new once a second.
  void measure(const LiveSession& session, const LiveTick& tick);
  /// The counts of the session begin at nothing: another one has taken over. The rates stay until the next second.
  void restart();
  [[nodiscard]] const LiveRates& rates() const { return rates_; }
  /// Whether a solve of the last 300 ms cut something.
  [[nodiscard]] bool cutting() const;

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point measured_ = Clock::now(), cut_at_;
  std::uint64_t ticks_before_ = 0, solves_before_ = 0, pictures_before_ = 0;
  double compute_before_ = 0; // s
  std::uint64_t cuts_seen_ = 0;
  LiveRates rates_;
};

} // namespace spherecut::app
