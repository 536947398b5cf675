// What viewers and session say to each other (docs/viewer_protocol.md): who holds the tool, what each client has asked
// for, and when a picture may go to whom. Everything on the web server's thread, but for sessions being built and
// ended.
#pragma once

#include "src/base/output_file.hpp"
#include "src/viewer/listed_files.hpp"
#include "src/viewer/replies.hpp"

#include <deque>
#include <map>

namespace spherecut::app {

struct HubOptions {
  std::filesystem::path scenario;   // the first one; its folder is the list to choose from
  std::filesystem::path recordings; // folder of those made here; made with the first
  int viewers = 16;
  double speed = 0.5;         // m/s, of the hand at most
  double frame_rate = 60;     // frames a second to a client at most
  double hello_patience = 10; // s
};

/// What a new session has to do with recordings.
struct Recorded {
  std::filesystem::path to{};              // it is written there
  std::shared_ptr<const Recording> from{}; // it plays this
  std::string name{};                      // of that
};

class Hub {
 public:
  /// Builds the session of the first scenario. Throws InputError and NumericalError. `say` is told from any thread what
  /// goes on.
  Hub(HubOptions options, std::function<void(const std::string&)> say);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;

  /// Before anything is served.
  void attach(WebServer& server) { server_ = &server; }
  [[nodiscard]] const LiveSession& session() const { return *session_; }

  // Handlers of the server:
  void opened(int client);
  [[nodiscard]] std::optional<CloseReason> message(int client, std::string_view text);
  void closed(int client);
  void tick();

 private:
  using Clock = std::chrono::steady_clock;
  struct Client {
    Clock::time_point since = Clock::now(), last_frame;
    bool greeted = false;
    int version = 1; // of the protocol, that it speaks
    int credit = 0;
    std::uint32_t messages = 0, left_out = 0;
    std::uint32_t topology = 0, epoch = 0; // of what was sent last
    std::uint64_t picture = 0, tick = 0;   // likewise
    std::uint64_t missed = 0;              // picture that was counted as left out
    Overlays overlays;
  };
  struct Building {
    std::string about; // the request
    std::string what;  // in words
    int client = 0;    // that asked
    std::optional<Scenario> scenario;
    LiveOptions options;
    std::string replayed;                 // name of the recording; empty: none
    std::atomic<bool> done{false};        // then the thread has left the rest to the server's
    std::unique_ptr<LiveSession> session; // null: it failed
    std::string code, failure;
    std::thread thread;
  };

  void send(int client, std::string text) { server_->send_text(client, std::move(text)); }
  void send_all(const std::string& text);
  void act(int client, Client& from, const Request& request);
  void greet(int client, Client& from);
  void take(int client);
  void let_go();
  void put_down(HandMode mode);
  void set_mode(int client, HandMode mode);
  void move(int client, const Request& request);
  void tell_inside(int client);
  void change(Client& from, int client, const OverlaysChange& overlays);
  void request_overlays();
  void choose(int client, const std::string& name);

  void record(int client, bool on);
  void replay(int client, const std::optional<std::string>& name);
  void tell_recording();
  [[nodiscard]] std::filesystem::path unused_recording() const;
  [[nodiscard]] std::vector<RecordingEntry> recordings(std::size_t& left_out) const;

  void build(int client, Scenario scenario, std::string_view about, const std::string& what,
             const Recorded& recorded = {});
  void start_building();
  void finish_building();
  void say_here(const std::string& line);
  void tell_log();
  void tell_failures();
  void tell_tear();
  void measure(const LiveTick& tick);
  void send_frames(const LiveTick& tick);
  void send_frame(int id, Client& client, const LiveTick& tick, bool picture);
  [[nodiscard]] std::uint32_t state_bits(const LiveTick& tick) const;
  [[nodiscard]] std::filesystem::path scenario_folder() const;
  [[nodiscard]] std::vector<ScenarioEntry> scenarios(std::size_t& left_out) const;

  HubOptions options_;
  std::function<void(const std::string&)> say_;
  WebServer* server_ = nullptr;
  std::map<int, Client> clients_;
  int holder_ = 0; // 0: nobody
  std::mutex log_mutex_;
  std::deque<std::string> log_; // guarded; from sessions
  Clock::time_point log_told_;

  std::unique_ptr<LiveSession> session_;
  ResultsClaim recordings_; // the folder, from the first recording on
  bool changed_ = false;    // settings of the session, from those of its file
  bool recording_ = false;  // told so
  std::string replaying_;   // name; empty: nothing is
  std::uint32_t epoch_ = 1;
  bool fifo_ = false;
  PointerTarget target_;
  bool parked_ = true;                            // the tool has not been led anywhere since it was put away
  std::optional<Clock::time_point> inside_since_; // since when it is wanted inside the organ all the same
  bool inside_told_ = false;
  std::unique_ptr<Building> building_, next_;
  std::thread ending_; // of the session before

  Clock::time_point measured_ = Clock::now();
  std::uint64_t ticks_before_ = 0, solves_before_ = 0, pictures_before_ = 0;
  double compute_before_ = 0; // s
  std::uint64_t cuts_seen_ = 0;
  TearStatus tear_;                   // as told
  std::uint32_t number_in_solve_ = 0; // of the viewer's message that the newest picture's solve followed
  Clock::time_point cut_at_;
  LiveRates rates_;
};

} // namespace spherecut::app
