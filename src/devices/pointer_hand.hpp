// A device that follows a pointer: a mouse or finger that says now and then where it wants the tool. Between two of its
// messages the hand moves on smoothly at no more than a given speed, and holds the tool by spring and damper, so that
// the tissue can push the tool away from it: on a pointer that feels nothing this is where the force shows.
#pragma once

#include "src/haptics/device.hpp"
#include "src/haptics/triple_buffer.hpp"

#include <array>

namespace spherecut::app {

/// What the pointer wants.
struct PointerTarget {
  std::uint32_t number = 0;           // of the viewer's message
  Vector3 position = Vector3::Zero(); // m, as DeviceState
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  HandMode mode = HandMode::probe;
  std::uint16_t buttons = 0;
  std::uint32_t jumps = 0; // another number than before: the tool is let go of and taken up there, in that mode
};

/// Where the hand was at a tick.
struct PointerHandState {
  std::uint64_t tick = 0;
  Vector3 hand = Vector3::Zero(); // m
  std::uint32_t number = 0;       // of the viewer's message that it followed
};

class PointerHand : public Device {
 public:
  /// `speed`: of the hand at most, m/s. Throws InputError unless mass, rate and speed are positive and the rest is not
  /// negative. The delay and resolution of `settings` do not matter here.
  PointerHand(const HandSettings& settings, double rate, double speed, const PointerTarget& start);

  /// Viewer thread: the newest target counts.
  void aim(const PointerTarget& target) noexcept;

  DeviceState read(std::uint64_t tick) noexcept override;
  void apply(const Vector3& force) noexcept override { force_ = force; }

  /// Viewer thread: the newest.
  [[nodiscard]] const PointerHandState& state() noexcept {
    states_.fetch();
    return states_.front();
  }
  /// Any thread: number of the message that a tick of the last seconds followed.
  [[nodiscard]] std::uint32_t number_at(std::uint64_t tick) const noexcept {
    return numbers_[tick % remembered].load(std::memory_order_relaxed);
  }

 private:
  void move_hand() noexcept;
  void move_tip() noexcept;
  void put_down() noexcept;

  static constexpr std::size_t remembered = 1U << 16U; // ticks, longer than solves take
  HandSettings settings_;
  double rate_, speed_;
  TripleBuffer<PointerHandState> states_;
  std::array<std::atomic<std::uint32_t>, remembered> numbers_{};
  TripleBuffer<PointerTarget> targets_;
  PointerTarget target_;
  Vector3 hand_, hand_velocity_ = Vector3::Zero();
  Vector3 position_, velocity_ = Vector3::Zero(), force_ = Vector3::Zero();
  Eigen::Quaterniond orientation_;
  HandMode mode_;
  std::uint32_t jumps_;
  int loose_ = 0; // ticks that the tool is in nobody's hand for
};

} // namespace spherecut::app
