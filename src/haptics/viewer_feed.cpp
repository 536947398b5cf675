#include "src/haptics/viewer_feed.hpp"

namespace spherecut::app {
namespace {

constexpr double share = 0.2; // of the simulation thread's time that frames may take

double seconds_between(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

} // namespace

void ViewerFeed::offer(const HapticSimulation& simulation, const SolveRecord& solve) {
  const Clock::time_point now = Clock::now();
  if (rate_ <= 0 || buffer_.waiting() || (number_ > 0 && seconds_between(last_, now) < 1 / rate_) ||
      seconds_ > share * seconds_between(start_, now))
    return;
  const Session& session = simulation.session();
  const StepResult& result = simulation.result();
  const topology::Wound* wound = session.wound();
  const topology::SurfaceMesh& surface = wound != nullptr ? wound->surface : session.organ().domain->surface();
  ViewerFrame& frame = buffer_.back();
  frame.number = ++number_;
  frame.time = result.time;
  frame.vertices.clear();
  for (std::size_t v = 0; v < surface.vertices.size(); ++v) {
    const Vector3& at = wound != nullptr ? wound->evaluation[v] : surface.vertices[v];
    frame.vertices.emplace_back((surface.vertices[v] + session.at(at).displacement).cast<float>());
  }
  frame.triangles = surface.triangles;
  frame.surface = surface.triangles.size();
  frame.tool = result.pose;
  frame.force = solve.force;
  frame.nodes = solve.nodes;
  frame.active = result.active_nodes;
  frame.degradation = solve.event.degradation;
  frame.cut_area = result.cut ? result.cut->area : 0;
  frame.solve_seconds = solve.seconds;
  buffer_.publish();
  last_ = now;
  seconds_ += seconds_between(now, Clock::now());
}

} // namespace spherecut::app
