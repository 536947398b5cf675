// The third rate: pictures of the session for a viewer, made by the simulation thread when there is time for one.
#pragma once

#include "src/haptics/simulation.hpp"
#include "src/haptics/triple_buffer.hpp"

#include <chrono>

namespace spherecut::app {

/// One picture.
struct ViewerFrame {
  std::uint64_t number = 0;              // 1, 2, ...; 0: none yet
  double time = 0;                       // s, of the solve
  std::vector<Eigen::Vector3f> vertices; // m, of the deformed surface, with the faces of the cut
  std::vector<Triangle> triangles;
  std::uint64_t surface = 0;       // changes when the triangles do
  topology::ToolPose tool;         // in the solve
  Vector3 force = Vector3::Zero(); // N, on the tool
  int nodes = 0, active = 0, degradation = 0;
  double cut_area = 0;      // m2
  double solve_seconds = 0; // wall clock of the solve
};

/// The simulation thread offers after every solve; the viewer fetches at its own pace. A frame is made when the viewer
/// has taken the last one, 1 / rate has passed since, and frames have taken no more than a fifth of the time so far:
/// pictures never take the solver's time.
class ViewerFeed {
 public:
  /// `rate` frames per second at most; 0: none.
  explicit ViewerFeed(double rate) : rate_(rate) {}

  /// Simulation thread; `solve`: the one that the simulation stands at.
  void offer(const HapticSimulation& simulation, const SolveRecord& solve);
  [[nodiscard]] double seconds() const { return seconds_; } // spent on frames
  [[nodiscard]] std::uint64_t frames() const { return number_; }

  /// Viewer thread: whether there is a newer frame; frame() then gives it.
  bool fetch() { return buffer_.fetch(); }
  [[nodiscard]] const ViewerFrame& frame() const { return buffer_.front(); }

 private:
  using Clock = std::chrono::steady_clock;
  double rate_;
  TripleBuffer<ViewerFrame> buffer_;
  Clock::time_point start_ = Clock::now(), last_ = start_;
  double seconds_ = 0;
  std::uint64_t number_ = 0;
};

} // namespace spherecut::app
