#include "experiments/remeshing_ledger/back_end.hpp"

#include <ctime>
#include <numeric>

namespace spherecut::experiments::ledger {

namespace {

double seconds_of(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

} // namespace

double processor_seconds() {
  return seconds_of(CLOCK_THREAD_CPUTIME_ID);
}

double wall_seconds() {
  return seconds_of(CLOCK_MONOTONIC);
}

double StageTimes::total_processor() const {
  return std::accumulate(processor.begin(), processor.end(), 0.0);
}

double StageTimes::total_wall() const {
  return std::accumulate(wall.begin(), wall.end(), 0.0);
}

std::string_view to_string(Element element) {
  switch (element) {
  case Element::linear:
    return "linear";
  case Element::quadratic:
    return "quadratic";
  default:
    return "quarter_point";
  }
}

} // namespace spherecut::experiments::ledger
