#include "experiments/support/slow_client.hpp"

#include <algorithm>
#include <utility>

namespace spherecut::experiments {

SlowClient::SlowClient(std::vector<app::PathPose> path, const app::HandSettings& hand,
                       const SlowClientSettings& settings, double rate)
    : settings_(settings), rate_(rate), hand_(std::move(path), hand, rate), pace_(rate), random_(settings.seed) {}

app::DeviceState SlowClient::read(std::uint64_t tick) noexcept {
  app::DeviceState state = hand_.read(tick);
  const double period = rate_ / settings_.rate; // ticks
  for (; next_ <= static_cast<double>(tick); next_ += period * (1 + settings_.jitter * (2 * uniform() - 1))) {
    if (std::exchange(has_read_, true))
      energy_ -= held_.dot(state.position - reading_);
    lowest_ = std::min(lowest_, energy_);
    reading_ = state.position;
    held_ = sent_;
    ++sequence_;
    if (uniform() < settings_.loss)
      continue;
    const bool late = uniform() < settings_.reordered;
    under_way_.push_back(
        {static_cast<double>(tick) + (late ? 1.5 * period : 0), sequence_, {0, state.position, state.orientation}});
  }
  for (auto packet = under_way_.begin(); packet != under_way_.end();) {
    if (packet->arrives > static_cast<double>(tick)) {
      ++packet;
      continue;
    }
    if (packet->sequence > newest_) { // as the bridge takes them
      newest_ = packet->sequence;
      pace_.take(packet->pose.position, packet->pose.orientation, tick);
    }
    packet = under_way_.erase(packet);
  }
  pace_.lead(state);
  return state;
}

void SlowClient::apply(const Vector3& force) noexcept {
  sent_ = force;
  hand_.apply(held_);
}

} // namespace spherecut::experiments
