// What viewers and session say to each other (docs/viewer_protocol.md): answers their requests, and tells them what the
// session does. Everything on the web server's thread, but for sessions being built and ended.
#pragma once

#include "src/viewer/held_tool.hpp"
#include "src/viewer/line_queue.hpp"
#include "src/viewer/offered_files.hpp"
#include "src/viewer/rate_meter.hpp"
#include "src/viewer/session_builder.hpp"
#include "src/viewer/viewers.hpp"

namespace spherecut::app {

struct HubOptions {
  std::filesystem::path scenario;   // the first one; its folder is the list to choose from
  std::filesystem::path recordings; // folder of those made here; made with the first
  int viewers = 16;
  double speed = 0.5;         // m/s, of the hand at most
  double frame_rate = 60;     // frames a second to a client at most
  double hello_patience = 10; // s
};

class Hub {
 public:
  /// Builds the session of the first scenario. Throws InputError and NumericalError. `say` is told what goes on, from
  /// the server's thread.
  Hub(HubOptions options, std::function<void(const std::string&)> say);

  /// Before anything is served.
  void attach(WebServer& server) { viewers_.attach(server); }
  [[nodiscard]] const LiveSession& session() const { return *session_; }

  // Handlers of the server:
  void opened(int client) { viewers_.add(client); }
  [[nodiscard]] std::optional<CloseReason> message(int client, std::string_view text);
  void closed(int client);
  void tick();

 private:
  void greet(int client, ViewerState& viewer);
  void act(int client, ViewerState& viewer, const Request& request);
  void take(int client);
  void let_go();
  void set_mode(int client, HandMode mode);
  void set_second(int client, bool on);
  void lay_second_away();
  void move(int client, const Request& request);

  // Another session:
  void record(int client, bool on);
  void replay(int client, const std::optional<std::string>& name);
  void build(SessionOrder order);
  void finish_building();
  void take_over(SessionOrder& order);

  // What the session does:
  void tell_log();
  void tell_recording();
  void tell_tear();
  void send_frames(const LiveTick& tick);
  [[nodiscard]] std::uint32_t state_bits(const LiveTick& tick) const;

  HubOptions options_;
  std::function<void(const std::string&)> say_;
  OfferedFiles files_;
  LineQueue log_;
  SessionBuilder builder_; // waits for the sessions that it builds and ends after the current one has ended
  std::unique_ptr<LiveSession> session_;
  HeldTool tool_, second_;                              // of both hands; whoever holds the first has the other
  bool second_on_ = false;                              // that one has the blade
  std::chrono::steady_clock::time_point second_laid_{}; // when it was last laid away
  Viewers viewers_;
  RateMeter meter_;
  bool changed_ = false;   // settings of the session, from those of its file
  bool recording_ = false; // told so
  std::string replaying_;  // name; empty: nothing is
  std::uint32_t epoch_ = 1;
  bool fifo_ = false;
  TearStatus tear_;                          // as told
  std::uint32_t number_in_solve_ = 0;        // of the viewer's message that the newest picture's solve followed
  std::uint32_t second_number_in_solve_ = 0; // likewise, for the second hand
};

} // namespace spherecut::app
