#include "src/tissue/blade_track.hpp"

namespace spherecut::app {
namespace {

constexpr double same_place = 1e-6; // of the fine spacing: a blade that has gone less has not moved
constexpr double rest_delay = 0.1;  // s without motion after which it is at rest

} // namespace

void BladeTrack::begin_step(const StepSample& sample, std::vector<topology::BladePose> passed, double fine) {
  passed_ = std::move(passed);
  if (sample.blade && (!last_ || edge_travel(scenario_.blade->edge, *last_, *sample.blade) > same_place * fine))
    moved_ = sample.time;
  rests_ = !sample.blade || sample.time - moved_ >= rest_delay;
}

void BladeTrack::arrive(const StepSample& sample) {
  if (sample.blade)
    last_ = sample.blade;
}

void BladeTrack::lift() {
  if (put_off_ == 0)
    last_.reset();
  lifted_ = hand_led_ = true;
}

double BladeTrack::way_to(const topology::BladePose& pose) const {
  double way = 0;
  topology::BladePose from = *last_;
  for (const topology::BladePose& next : passed_) {
    way += edge_travel(scenario_.blade->edge, from, next);
    from = next;
  }
  return way + edge_travel(scenario_.blade->edge, from, pose);
}

} // namespace spherecut::app
