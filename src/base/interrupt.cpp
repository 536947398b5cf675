#include "src/base/interrupt.hpp"

#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cstring>
#include <unistd.h>

namespace spherecut::app {
namespace {

// What the handlers need, ready before they are installed: they may not allocate.
struct LastWords {
  char text[4096] = {};
  std::size_t size = 0;
  int status = 0;
  timer_t timer{};
  bool timed = false;
};
LastWords last;

void end_now(int) {
  if (last.size > 0 && ::write(STDOUT_FILENO, last.text, last.size) < 0)
    ::_exit(last.status); // nobody reads them
  ::_exit(last.status);
}

void end_within(double seconds) {
  if (!last.timed)
    return;
  itimerspec patience{};
  patience.it_value.tv_sec = static_cast<time_t>(seconds);
  patience.it_value.tv_nsec = static_cast<long>(1e9 * (seconds - static_cast<double>(patience.it_value.tv_sec)));
  ::timer_settime(last.timer, 0, &patience, nullptr);
}

void note(int) {
  request_interruption();
  end_within(interrupt_patience);
}

} // namespace

InterruptWatch::InterruptWatch(const std::string& last_words, int status) {
  withdraw_interruption();
  last = {};
  last.size = std::min(last_words.size(), sizeof last.text - 1);
  std::memcpy(last.text, last_words.data(), last.size);
  if (last.size > 0)
    last.text[last.size++] = '\n';
  last.status = status;
  struct sigaction action {};
  action.sa_handler = end_now;
  sigemptyset(&action.sa_mask);
  sigaction(SIGALRM, &action, &timer_before_);
  sigevent event{};
  event.sigev_notify = SIGEV_SIGNAL;
  event.sigev_signo = SIGALRM;
  last.timed = ::timer_create(CLOCK_MONOTONIC, &event, &last.timer) == 0;
  action.sa_handler = note;
  action.sa_flags = static_cast<int>(SA_RESETHAND); // the second signal has its default effect
  sigaction(SIGINT, &action, &interrupt_before_);
  sigaction(SIGTERM, &action, &terminate_before_);
}

InterruptWatch::~InterruptWatch() {
  sigaction(SIGINT, &interrupt_before_, nullptr);
  sigaction(SIGTERM, &terminate_before_, nullptr);
  if (last.timed)
    ::timer_delete(last.timer);
  last.timed = false;
  sigaction(SIGALRM, &timer_before_, nullptr);
  withdraw_interruption();
}

bool InterruptWatch::interrupted() const {
  return interruption_requested();
}

void InterruptWatch::wind_up() const {
  if (interrupted())
    end_within(writing_patience);
}

} // namespace spherecut::app
