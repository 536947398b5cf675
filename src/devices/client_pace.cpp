#include "src/devices/client_pace.hpp"

#include "src/haptics/tick.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::app {
namespace {

constexpr double remembered = 0.5;                     // s, over which the rate is measured
constexpr double leads_from = 1.5, leads_until = 1.25; // ticks between two poses
constexpr double uneven_from = 1.0 / 16;               // share of the ticks without a pose, at the loop's rate
constexpr double uneven_for = 1;                       // s, as which a client counts that was so
constexpr double least_way = 2;                        // ticks
constexpr double fades_from = slowest_client - 1;      // poses a second: one lost in fifty does not count
constexpr double fade = 0.1;                           // s
constexpr double settled = 0.2;                        // s
constexpr std::size_t known_from = 4;                  // poses

} // namespace

void ClientPace::begin() noexcept {
  count_ = 0;
  measured_ = 0;
  kind_ = PaceKind::unknown;
  fresh_ = leads_ = false;
  uneven_until_ = 0;
  length_ = 1;
  share_ = 1;
}

void ClientPace::take(const Vector3& position, const Eigen::Quaterniond& orientation, std::uint64_t tick) noexcept {
  const bool first = count_ == 0;
  const double passed = first ? 1 : std::max(1.0, static_cast<double>(tick - taken_));
  const bool placed = first || (position - to_.position).norm() * rate_ > fastest_hand * passed;
  arrivals_[count_ % window] = tick;
  ++count_;
  measure(tick);
  to_ = {0, position, orientation};
  from_ = placed || !leads_ ? to_ : at_;
  began_ = taken_ = tick;
  fresh_ = true;
}

void ClientPace::measure(std::uint64_t tick) noexcept {
  const std::size_t kept = std::min(count_, window);
  std::size_t used = 1; // newest first
  const auto at = [&](std::size_t back) { return arrivals_[(count_ - 1 - back) % window]; };
  while (used < kept && static_cast<double>(tick - at(used)) <= remembered * rate_)
    ++used;
  if (count_ < 2)
    return;
  used = std::max<std::size_t>(used, 2);
  const auto span = static_cast<double>(at(0) - at(used - 1));
  const double mean = std::max(1.0, span / static_cast<double>(used - 1));
  const auto silence = static_cast<double>(tick - at(0));
  // Who has been silent for two poses' time may be slower now.
  const double period = silence > 2 * mean ? (span + silence) / static_cast<double>(used) : mean;
  measured_ = rate_ / period;
  std::uint64_t empty = 0; // ticks without a pose
  for (std::size_t back = 0; back + 1 < used; ++back)
    empty += std::max<std::uint64_t>(at(back) - at(back + 1), 1) - 1;
  if (used == window && static_cast<double>(empty) >= uneven_from * span)
    uneven_until_ = tick + static_cast<std::uint64_t>(uneven_for * rate_);
  leads_ = mean > (leads_ ? leads_until : leads_from) || tick < uneven_until_;
  length_ = std::max(leads_ ? least_way : 1.0, std::round(mean));
  const bool is_settled = span + silence >= settled * rate_; // a few poses may come late by chance
  const bool slow =
      is_settled && measured_ < (kind_ == PaceKind::too_slow ? slowest_client : std::min(fades_from, rate_ - 1));
  kind_ = count_ < known_from ? PaceKind::unknown
          : slow              ? PaceKind::too_slow
          : leads_            ? PaceKind::interpolated
                              : PaceKind::full;
}

void ClientPace::lead(DeviceState& state) noexcept {
  if (count_ == 0)
    return;
  if (!fresh_)
    measure(state.tick);
  const double share = leads_ ? std::min(1.0, (static_cast<double>(state.tick - began_) + 1) / length_) : 1.0;
  at_.position = share < 1 ? Vector3(from_.position + share * (to_.position - from_.position)) : to_.position;
  at_.orientation = share < 1 ? from_.orientation.slerp(share, to_.orientation) : to_.orientation;
  const double step = 1 / (fade * rate_);
  share_ = std::clamp(share_ + (kind_ == PaceKind::too_slow ? -step : step), 0.0, 1.0);
  state.position = at_.position;
  state.orientation = at_.orientation;
  state.client = {to_.position, leads_ ? length_ : 1, share_, fresh_};
  fresh_ = false;
}

void PaceWatch::count(const ClientPace& pace, const DeviceState& state, PaceCounters& counters) noexcept {
  const double rate = pace.measured();
  if (rate > 0) {
    counters.rate = rate;
    if (pace.kind() != PaceKind::unknown)
      counters.slowest = counters.slowest > 0 ? std::min(counters.slowest, rate) : rate;
  }
  counters.interpolated += state.client.period > 1 ? 1 : 0;
  counters.faded += pace.kind() == PaceKind::too_slow ? 1 : 0;
  kind_.store(pace.kind(), std::memory_order_relaxed);
  rate_.store(rate, std::memory_order_relaxed);
}

} // namespace spherecut::app
