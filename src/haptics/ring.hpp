// Every value from one thread to another, in order, without locks and without waiting: a ring of a fixed size.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

namespace spherecut::app {

/// One writer thread, one reader thread. Its slots are made once; a full ring takes nothing.
template <typename T>
class Ring {
 public:
  explicit Ring(std::size_t slots) : slots_(slots) {}

  /// Writer: false when the reader is a whole ring behind; the value is then not taken.
  bool push(const T& value) {
    const std::size_t written = written_.load(std::memory_order_relaxed);
    if (written - read_.load(std::memory_order_acquire) == slots_.size())
      return false;
    slots_[written % slots_.size()] = value;
    written_.store(written + 1, std::memory_order_release);
    return true;
  }

  [[nodiscard]] std::size_t slots() const noexcept { return slots_.size(); }

  /// Reader: how many values wait.
  [[nodiscard]] std::size_t waiting() const noexcept {
    return written_.load(std::memory_order_acquire) - read_.load(std::memory_order_relaxed);
  }
  /// Reader: the oldest of them, until pop(). Only while waiting() is not 0.
  [[nodiscard]] T& front() noexcept { return slots_[read_.load(std::memory_order_relaxed) % slots_.size()]; }
  void pop() noexcept { read_.store(read_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

 private:
  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> written_ = 0;
  alignas(64) std::atomic<std::size_t> read_ = 0;
};

} // namespace spherecut::app
