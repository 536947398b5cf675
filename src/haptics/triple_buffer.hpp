// The newest value from one thread to another, without locks and without waiting: three slots, of which the writer owns
// one, the reader one, and the third changes hands by one atomic exchange.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace spherecut::app {

/// One writer thread, one reader thread. Values that the reader does not fetch in time are overwritten by newer ones.
template <typename T>
class TripleBuffer {
 public:
  TripleBuffer() = default;
  explicit TripleBuffer(const T& initial) : slots_{initial, initial, initial} {}

  /// Writer: the slot to fill; it holds some older value.
  [[nodiscard]] T& back() noexcept { return slots_[back_]; }
  /// Writer: hands the filled slot over and takes another.
  void publish() noexcept {
    back_ = middle_.exchange(static_cast<std::uint8_t>(back_ | fresh), std::memory_order_acq_rel) & index;
  }

  /// Reader: whether something newer than front() waits.
  [[nodiscard]] bool waiting() const noexcept { return (middle_.load(std::memory_order_acquire) & fresh) != 0; }
  /// Reader: takes the newest value over, if there is one since the last call.
  bool fetch() noexcept {
    if (!waiting())
      return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & index;
    return true;
  }
  /// Reader: the value fetched last.
  [[nodiscard]] const T& front() const noexcept { return slots_[front_]; }

 private:
  static constexpr std::uint8_t index = 3;
  static constexpr std::uint8_t fresh = 4;
  std::array<T, 3> slots_{};
  alignas(64) std::uint8_t back_ = 0;                // the writer's
  alignas(64) std::atomic<std::uint8_t> middle_ = 1; // with the fresh flag
  alignas(64) std::uint8_t front_ = 2;               // the reader's
};

} // namespace spherecut::app
