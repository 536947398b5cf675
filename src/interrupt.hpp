// SIGINT and SIGTERM as a question that a run asks between its steps.
#pragma once

#include <csignal>

namespace spherecut::app {

/// While it lives, the first SIGINT or SIGTERM is noted; a second one ends the program at once. One at a time.
class InterruptWatch {
 public:
  InterruptWatch();
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;
  [[nodiscard]] bool interrupted() const;

 private:
  struct sigaction interrupt_before_ {};
  struct sigaction terminate_before_ {};
};

} // namespace spherecut::app
