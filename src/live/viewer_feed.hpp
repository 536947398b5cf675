// The third rate: pictures of the session for viewers, made by the simulation thread when there is time for one.
#pragma once

#include "src/haptics/loop_records.hpp"
#include "src/haptics/triple_buffer.hpp"
#include "src/live/simulation.hpp"
#include "src/live/surface_follower.hpp"
#include "src/live/tear_status.hpp"

#include <chrono>
#include <mutex>

namespace spherecut::app {

/// What viewers want to see besides the surface. Keys tell who asked.
struct ViewerRequest {
  struct Pick {
    int key = 0;
    int node = -1;                   // its number, or -1: the nearest to `place`
    Vector3 place = Vector3::Zero(); // m, of the deformed body
  };
  struct Slice {
    int key = 0;
    Vector3 point = Vector3::Zero(), normal = Vector3::UnitZ(); // m, unit: centre and plane, at rest
    double size = 0.1;                                          // m, edge of the square
    int count = 64;                                             // samples along an edge, 2 to 256
  };
  bool displacement = false, von_mises = false, nodes = false;
  std::vector<Pick> picks;
  std::vector<Slice> slices;
};

struct PickedNode {
  int key = 0, node = 0;
  Vector3 position = Vector3::Zero(); // m, deformed
  double radius = 0;                  // m, of its sphere; of a place without one, of the nearest sphere
  std::vector<int> seen, hidden;      // nodes within it that have spheres, without itself; hidden: by the cut
};

struct FieldSlice {
  int key = 0, count = 0;
  Vector3 corner, along, up;     // m, whole edges; samples at both ends
  std::vector<float> organ, cut; // m, count x count, along fastest: signed distance to the surface; distance to the cut
};

/// One picture.
struct ViewerFrame {
  std::uint64_t number = 0;               // 1, 2, ...; 0: none yet
  std::uint64_t solve = 0, pose_tick = 0; // of the solve, and the tick of its pose
  double time = 0;                        // s, of the solve
  std::shared_ptr<const ViewerTopology> topology;
  std::vector<Eigen::Vector3f> vertices; // m, deformed, of topology's vertices
  double largest_displacement = 0;       // m, of a vertex
  topology::ToolPose tool;               // in the solve
  Vector3 force = Vector3::Zero();       // N, on what the hand holds
  double contact_radius = 0;             // m
  int nodes = 0, active = 0, degradation = 0;
  double cut_area = 0, front_length = 0;  // m2, m
  double opening = 0, opening_volume = 0; // m, m3, of the picture
  TearStatus tear;
  double solve_seconds = 0;                   // wall clock of the solve
  SessionProfile profile;                     // of the whole session
  double picture_seconds = 0;                 // wall clock in pictures so far
  std::vector<float> displacement, von_mises; // per vertex, m and Pa; empty: not asked for
  struct Node {
    Eigen::Vector3f position; // m, deformed
    float radius;             // m, of its support
    solvers::NodeKind kind;
  };
  std::vector<Node> node_list; // empty: not asked for
  std::vector<PickedNode> picks;
  std::vector<FieldSlice> slices;
};

/// The simulation thread offers after every solve; the viewer fetches at its own pace. A frame is made when the viewer
/// has taken the last one, 1 / rate has passed since, and frames have taken no more than a fifth of the time so far:
/// pictures never take the solver's time.
class ViewerFeed {
 public:
  /// `rate` frames per second at most; 0: none.
  explicit ViewerFeed(double rate) : rate_(rate) {}

  /// Simulation thread, after a solve; `solve`: the one that the simulation stands at.
  void offer(const HapticSimulation& simulation, const SolveRecord& solve);
  /// Simulation thread, between solves: makes the picture of the last one that could not be made yet, or that a new
  /// request wants anew.
  void offer_again(const HapticSimulation& simulation);
  [[nodiscard]] double seconds() const { return seconds_; } // spent on frames
  [[nodiscard]] std::uint64_t frames() const { return number_; }

  /// Viewer thread: what pictures should hold from the next one on.
  void request(ViewerRequest request);
  /// Viewer thread: whether there is a newer frame; frame() then gives it.
  bool fetch() { return buffer_.fetch(); }
  [[nodiscard]] const ViewerFrame& frame() const { return buffer_.front(); }

 private:
  using Clock = std::chrono::steady_clock;
  void make(const HapticSimulation& simulation);
  void add_extras(const HapticSimulation& simulation, ViewerFrame& frame);

  double rate_;
  TripleBuffer<ViewerFrame> buffer_;
  SurfaceFollower follower_;
  ViewerFrame last_; // numbers of the last solve; without surface
  bool pending_ = false;
  std::mutex request_mutex_;
  ViewerRequest wanted_;      // guarded
  bool newly_wanted_ = false; // guarded
  ViewerRequest request_;     // the simulation thread's copy
  Clock::time_point start_ = Clock::now(), made_ = start_;
  double seconds_ = 0;
  std::uint64_t number_ = 0;
};

} // namespace spherecut::app
