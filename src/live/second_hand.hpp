// The second hand of a haptic loop: its device, and the ticks that it feels. It has the blade beside the tool of the
// first hand.
#pragma once

#include "src/haptics/loop_records.hpp"

namespace spherecut::app {

/// What a solve hands to the ticks of both hands.
struct BothSnapshots {
  ContactSnapshot first, second;
};

class SecondHand {
 public:
  /// `device` null: there is none. Tool and organ must outlive this.
  SecondHand(const HapticSettings& settings, const topology::ToolShape& tool, const topology::ContactQuery& organ,
             Device* device)
      : device_(device), core_(settings, tool, &organ, false) {}

  [[nodiscard]] bool is_there() const noexcept { return device_ != nullptr; }
  [[nodiscard]] Device* device() const noexcept { return device_; }

  /// Its snapshot of a solve that the loop takes over. From then on the one before may go.
  void arrive(const ContactSnapshot& snapshot) noexcept {
    if (is_there())
      core_.arrive(snapshot);
  }

  /// After the first hand's tick; adds what this one feels to that tick's record. Neither allocates, locks, waits nor
  /// throws.
  void tick(const Hands& hands, TickRecord& record) noexcept {
    if (!is_there())
      return;
    const TickResult result = core_.tick(hands.second ? with_blade(*hands.second) : idle_hand(hands.first));
    device_->render(result.force, result.torque);
    record.two_hands = true;
    record.second.reset();
    if (hands.second)
      record.second = second_record_of(*hands.second, result);
  }

 private:
  Device* device_;
  HapticTick core_;
};

} // namespace spherecut::app
