// The clients of the server: what each has asked to see, and when a picture may go to it.
#pragma once

#include "src/viewer/requests.hpp"
#include "src/viewer/web_server.hpp"

#include <map>

namespace spherecut::app {

struct ViewerState {
  using Clock = std::chrono::steady_clock;
  Clock::time_point since = Clock::now(), last_frame;
  bool greeted = false;
  int version = 1; // of the protocol, that it speaks
  int credit = 0;  // frames that it takes
  std::uint32_t messages = 0, left_out = 0;
  std::uint32_t topology = 0, epoch = 0; // of what was sent last
  std::uint64_t picture = 0, tick = 0;   // likewise
  std::uint64_t missed = 0;              // picture that was counted as left out
  Overlays overlays;
};

/// On the web server's thread. Sending may end a client, and so call for its removal.
class Viewers {
 public:
  /// `frame_rate`: frames a second to a client at most.
  explicit Viewers(double frame_rate) : frame_rate_(frame_rate) {}
  /// Before anything is sent.
  void attach(WebServer& server) { server_ = &server; }

  void add(int id) { viewers_.emplace(id, ViewerState{}); }
  void remove(int id) { viewers_.erase(id); }
  /// Null: there is none.
  [[nodiscard]] ViewerState* find(int id);

  void send(int id, std::string text) { server_->send_text(id, std::move(text)); }
  /// To all that have been greeted.
  void send_all(const std::string& text);
  /// The work of a request, in messages.
  void charge(int id, double messages) { server_->charge(id, messages); }
  /// Closes those that have not said hello within `patience` s.
  void close_silent(double patience);

  void change_overlays(int id, const OverlaysChange& change);
  /// What all of them together have asked to see.
  [[nodiscard]] ViewerRequest wanted() const;

  /// What a frame tells everyone: epoch, state, number_in_solve and rates.
  using CommonContext = std::function<FrameContext()>;
  /// Sends picture and tick to those that are due, have credit and have read what they were sent.
  void send_frames(const ViewerFrame& frame, const LiveTick& tick, std::uint32_t epoch, const CommonContext& context);

 private:
  [[nodiscard]] std::vector<int> ids() const;
  void send_frame(int id, ViewerState& viewer, const ViewerFrame& frame, const LiveTick& tick, FrameContext context,
                  bool picture);

  double frame_rate_;
  WebServer* server_ = nullptr;
  std::map<int, ViewerState> viewers_;
};

} // namespace spherecut::app
