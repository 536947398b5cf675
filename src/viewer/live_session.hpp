// A session that goes on until it is told to stop, with the tool in the hand of a viewer: the real loop of three
// threads (src/live/realtime_loop.hpp) behind calls that a viewer's thread makes and that never wait for it.
#pragma once

#include "src/live/realtime_loop.hpp"
#include "src/viewer/session_recorder.hpp"
#include "src/viewer/tool_places.hpp"

#include <thread>

namespace spherecut::app {

/// Where a pointer's hand is, and what it follows.
struct LiveHand {
  Vector3 position = Vector3::Zero(); // m
  std::uint32_t number = 0;           // of the viewer's message that it follows
};

/// The haptic loop at one tick, and sums since the start.
struct LiveTick {
  TickRecord record;
  topology::SurfaceContact contact; // on the surface at rest; of a blade where its edge is deepest
  Vector3 axis = Vector3::UnitZ();  // of the tool
  LiveHand hand, second_hand;
  double second_depth = 0; // m, of the blade in the second hand, where it has one, in the organ at rest
  std::uint64_t overruns = 0;
  double compute = 0;       // s of processor time in ticks
  double worst_latency = 0; // s, of the last whole second of ticks
};

inline constexpr int most_live_nodes = 6000; // a live session with more would not be one

struct LiveOptions {
  double speed = 0.5;                        // m/s, of the pointer's hand at most
  std::filesystem::path record{};            // file to write the session to; empty: it is not recorded
  std::shared_ptr<const Recording> replay{}; // whose motion is followed instead of a pointer; null: none
};

class LiveSession {
 public:
  /// Builds and condenses the body; takes seconds. Throws InputError and NumericalError. `say` is called from this
  /// thread and later from that of the simulation.
  LiveSession(Scenario scenario, const LiveOptions& options, std::function<void(const std::string&)> say);
  /// Stops; waits for the solve that is under way.
  ~LiveSession();
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  void start();

  [[nodiscard]] const Scenario& scenario() const { return scenario_; }
  [[nodiscard]] const topology::Domain& domain() const { return *domain_; }
  [[nodiscard]] const ToolPlaces& places() const { return *places_; }
  /// Nodes at the start.
  [[nodiscard]] int nodes() const { return nodes_; }
  [[nodiscard]] double fine_spacing() const { return fine_; }     // m
  [[nodiscard]] double coarse_spacing() const { return coarse_; } // m

  // One viewer thread:
  /// Whether there is something for each of two hands: a tool and a blade.
  [[nodiscard]] bool takes_two_hands() const { return scenario_.tool && scenario_.blade; }
  /// Without effect in a replay, and for a second hand that has nothing to hold.
  void aim(const PointerTarget& target, WhichHand hand = WhichHand::first);
  [[nodiscard]] bool replays() const { return hand_ == nullptr; }
  [[nodiscard]] const SessionRecorder& recorder() const { return recorder_; }
  void stop_recording() { recorder_.stop(); }
  void request(ViewerRequest request) { feed_->request(std::move(request)); }
  bool fetch_frame() { return feed_->fetch(); }
  [[nodiscard]] const ViewerFrame& frame() const { return feed_->frame(); }
  /// Number of the viewer's message that a tick of the last seconds followed.
  [[nodiscard]] std::uint32_t number_at(std::uint64_t tick, WhichHand hand = WhichHand::first) const {
    const PointerHand* const pointer = hand == WhichHand::first ? hand_ : second_;
    return pointer != nullptr ? pointer->number_at(tick) : 0;
  }
  /// The newest tick.
  const LiveTick& tick();
  [[nodiscard]] std::uint64_t solves() const { return solves_; }
  [[nodiscard]] std::uint64_t cuts() const { return cuts_; } // solves that cut something
  [[nodiscard]] bool failing() const { return failing_; }    // the last solve failed
  /// Why solves have failed since the last call, each reason once, and what ended the loop.
  std::vector<std::string> failures() { return failures_.take(); }

 private:
  void run();
  void note(const TickRecord& record);
  void note(const SolveRecord& record);

  Scenario scenario_;
  std::unique_ptr<HapticSimulation> simulation_;
  std::shared_ptr<const topology::Domain> domain_;
  std::unique_ptr<const ToolPlaces> places_;
  int nodes_ = 0;
  double fine_ = 0, coarse_ = 0;
  std::unique_ptr<Device> device_, second_device_; // null: there is nothing for a second hand
  PointerHand* hand_ = nullptr;                    // device_; null in a replay
  PointerHand* second_ = nullptr;                  // second_device_; likewise
  FailureList failures_;
  SessionRecorder recorder_{failures_};
  std::unique_ptr<ViewerFeed> feed_;
  TripleBuffer<LiveTick> ticks_; // from the loop's thread
  LiveTick newest_, summed_;     // the viewer thread's; the loop's
  double latency_ = 0;           // s, worst in this second, the loop's
  std::atomic<std::uint64_t> solves_{0}, cuts_{0};
  std::atomic<bool> failing_{false}, stop_{false};
  std::thread thread_;
};

} // namespace spherecut::app
