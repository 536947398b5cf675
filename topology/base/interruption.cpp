#include "topology/base/interruption.hpp"

#include <atomic>

namespace spherecut {
namespace {

std::atomic<bool> interruption_wanted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal's handler sets it");
thread_local bool winds_up = false;

} // namespace

void request_interruption() noexcept {
  interruption_wanted.store(true, std::memory_order_relaxed);
}

void withdraw_interruption() noexcept {
  interruption_wanted.store(false, std::memory_order_relaxed);
}

bool interruption_requested() noexcept {
  return interruption_wanted.load(std::memory_order_relaxed);
}

void interruption_point() {
  if (interruption_requested() && !winds_up)
    throw Interrupted();
}

WindingUp::WindingUp(bool on) noexcept : before_(winds_up) {
  winds_up = on;
}

WindingUp::~WindingUp() {
  winds_up = before_;
}

bool WindingUp::of_this_thread() noexcept {
  return winds_up;
}

} // namespace spherecut
