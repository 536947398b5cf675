// SIGINT and SIGTERM as a question that a run asks between its steps, and that long computations ask themselves
// (topology/base/interruption.hpp).
#pragma once

#include <csignal>
#include <ctime>
#include <string>

namespace spherecut::app {

/// Time from the first signal to the end of what is being computed at the latest, and from there for what has to be
/// written, s. Results are small: that takes a fraction of it, but on a slow disk they shall not be lost.
inline constexpr double interrupt_patience = 1.5, writing_patience = 10;

/// While it lives, the first SIGINT or SIGTERM is noted: interruption_point() throws from then on. What does not come
/// to such a point or to its own end within interrupt_patience is ended as it is, by the system's timer, with the last
/// words and the exit status given here: libraries that factor and triangulate know of no interrupt. A second signal
/// ends the program at once. One at a time.
class InterruptWatch {
 public:
  /// `last_words`: a line for the standard output; empty: none. `status`: exit status of that end.
  explicit InterruptWatch(const std::string& last_words, int status);
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;
  [[nodiscard]] bool interrupted() const;
  /// The computations have ended, and what they gave is being written: time for that begins anew.
  void wind_up() const;

 private:
  struct sigaction interrupt_before_ {};
  struct sigaction terminate_before_ {};
  struct sigaction timer_before_ {};
};

} // namespace spherecut::app
