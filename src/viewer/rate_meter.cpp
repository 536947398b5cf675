#include "src/viewer/rate_meter.hpp"

namespace spherecut::app {
namespace {

constexpr auto cutting_shown = std::chrono::milliseconds(300);

} // namespace

void RateMeter::measure(const LiveSession& session, const LiveTick& tick) {
  if (const std::uint64_t cuts = session.cuts(); cuts != cuts_seen_) {
    cuts_seen_ = cuts;
    cut_at_ = Clock::now();
  }
  const double passed = std::chrono::duration<double>(Clock::now() - measured_).count();
  if (passed < 1)
    return;
  const std::uint64_t ticks = tick.record.device.tick;
  const std::uint64_t solves = session.solves();
  const std::uint64_t pictures = session.frame().number;
  const auto done = static_cast<double>(ticks - ticks_before_);
  rates_.ticks = done / passed;
  rates_.solves = static_cast<double>(solves - solves_before_) / passed;
  rates_.pictures = static_cast<double>(pictures - pictures_before_) / passed;
  rates_.tick_seconds = done > 0 ? (tick.compute - compute_before_) / done : 0;
  measured_ = Clock::now();
  ticks_before_ = ticks;
  solves_before_ = solves;
  pictures_before_ = pictures;
  compute_before_ = tick.compute;
}

void RateMeter::restart() {
  measured_ = Clock::now();
  ticks_before_ = solves_before_ = pictures_before_ = cuts_seen_ = 0;
  compute_before_ = 0;
}

bool RateMeter::cutting() const {
  return cuts_seen_ > 0 && Clock::now() - cut_at_ < cutting_shown;
}

} // namespace spherecut::app
