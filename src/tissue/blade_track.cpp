#include "src/tissue/blade_track.hpp"

#include <cmath>

namespace spherecut::app {
namespace {

constexpr double same_place = 1e-6; // of the fine spacing: a blade that has gone less has not moved
constexpr double rest_delay = 0.1;  // s without motion after which it is at rest
constexpr double on_path = 1e-6;    // of the fine spacing: nearer to its path a blade is on it
constexpr double way_detail = 0.25; // fine spacings from pose to pose of the way ahead

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

std::vector<topology::BladePose> BladeTrack::ahead(const StepSample& here,
                                                   const std::optional<topology::BladePose>& last, bool placed,
                                                   const std::vector<StepSample>& steps, double length,
                                                   double fine) const {
  const std::vector<Vector3>& edge = scenario_.blade->edge;
  const topology::BladePose& pose = *here.blade;
  std::vector<topology::BladePose> poses;
  if (!placed)
    poses.push_back(pose);
  const auto scripted = blade_pose(*scenario_.blade, here.time);
  if (scripted && edge_travel(edge, *scripted, pose) < on_path * fine) {
    // Poses of short steps lie closer than a window can tell apart, and each costs a strip.
    double way = 0, since_pose = 0;
    topology::BladePose before = pose;
    for (const StepSample& step : steps) {
      if (!step.blade || step.time <= here.time || way >= length)
        continue;
      const double travel = edge_travel(edge, before, *step.blade);
      way += travel;
      since_pose += travel;
      before = *step.blade;
      if (since_pose >= way_detail * fine || way >= length) {
        poses.push_back(before);
        since_pose = 0;
      }
    }
    if (since_pose > 0)
      poses.push_back(before);
  } else if (last) {
    const Vector3 motion = pose.position - last->position;
    for (int k = 1; k <= static_cast<int>(std::lround(length / fine)) && motion.norm() > 0; ++k)
      poses.push_back({pose.time + k, pose.position + k * fine * motion.normalized(), pose.orientation});
  }
  return poses;
}

} // namespace spherecut::app
