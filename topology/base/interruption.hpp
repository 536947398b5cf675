// A question that long computations ask: whether they are still wanted. The answer comes from a signal's handler.
#pragma once

#include <exception>

namespace spherecut {

/// Thrown where a computation is given up because nobody wants it any more. Like an error it leaves no partial state.
class Interrupted : public std::exception {
 public:
  [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }
};

/// From now on every interruption_point() of the process throws. Safe in a signal's handler.
void request_interruption() noexcept;
void withdraw_interruption() noexcept;
[[nodiscard]] bool interruption_requested() noexcept;

/// Throws Interrupted after request_interruption(), but not within a WindingUp of this thread. A few nanoseconds.
void interruption_point();

/// While it lives, this thread's computations go on to their end: what is left to do after an interruption. Loops of
/// solvers/algebra/parallel.hpp hand that on to the threads that they use.
class WindingUp {
 public:
  explicit WindingUp(bool on = true) noexcept;
  ~WindingUp();
  WindingUp(const WindingUp&) = delete;
  WindingUp& operator=(const WindingUp&) = delete;
  [[nodiscard]] static bool of_this_thread() noexcept;

 private:
  bool before_;
};

} // namespace spherecut
