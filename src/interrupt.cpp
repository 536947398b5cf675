#include "src/interrupt.hpp"

namespace spherecut::app {
namespace {

volatile std::sig_atomic_t noted = 0;

void note(int) {
  noted = 1;
}

} // namespace

InterruptWatch::InterruptWatch() {
  noted = 0;
  struct sigaction action {};
  action.sa_handler = note;
  action.sa_flags = static_cast<int>(SA_RESETHAND); // the second signal has its default effect
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &interrupt_before_);
  sigaction(SIGTERM, &action, &terminate_before_);
}

InterruptWatch::~InterruptWatch() {
  sigaction(SIGINT, &interrupt_before_, nullptr);
  sigaction(SIGTERM, &terminate_before_, nullptr);
}

bool InterruptWatch::interrupted() const {
  return noted != 0;
}

} // namespace spherecut::app
