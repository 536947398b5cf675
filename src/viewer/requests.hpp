// JSON messages between viewers and server, as docs/viewer_protocol.md has them: read into structs, written as text.
#pragma once

#include "src/viewer/web_server.hpp"
#include "src/viewer/wire.hpp"

namespace spherecut::app {

inline constexpr int most_credit = 8; // frames on their way to a client

enum class RequestType {
  hello,
  credit,
  take,
  release,
  mode,
  pose,
  park,
  grip,
  reset,
  scenario,
  set,
  overlays,
  record,
  replay,
};
std::string_view to_string(RequestType type);
/// Whether only the client that holds the tool may ask for it.
bool needs_tool(RequestType type);

/// What a viewer wants changed; empty: as it is.
struct SettingsChange {
  std::optional<double> young_modulus, poisson_ratio, toughness; // Pa, 1, J/m2
  std::optional<double> fine_spacing, coarse_spacing;            // m
  std::optional<solvers::Method> method;
  std::optional<solvers::SightRule> sight;
};

struct OverlaysChange {
  std::optional<Overlays::Colour> colour;
  std::optional<bool> nodes, stages;
  std::optional<std::optional<ViewerRequest::Pick>> pick;
  std::optional<std::optional<ViewerRequest::Slice>> slice;
};

/// One message; the fields of its type count.
struct Request {
  RequestType type = RequestType::hello;
  int number = 0;                                  // hello: version; credit: frames
  std::uint32_t pose = 0;                          // pose: n
  Vector3 position = Vector3::Zero();              // pose, m
  std::optional<Eigen::Quaterniond> orientation{}; // pose, unit
  HandMode mode = HandMode::probe;
  bool on = false;                   // record, grip
  std::optional<std::string> name{}; // scenario; replay: empty ends it
  SettingsChange settings{};
  OverlaysChange overlays{};
};

/// Throws InputError, in words for the reason of a close, when the text is not such a message.
Request parse_request(std::string_view text);

/// The scenario with the change. Throws InputError with the key, the value and what is allowed.
void apply(const SettingsChange& change, Scenario& scenario);

struct ScenarioEntry {
  std::string name, title;
};
struct RecordingEntry {
  std::string name;
  std::uint64_t bytes = 0;
};

std::string welcome_text(int client, const std::vector<ScenarioEntry>& scenarios,
                         const std::vector<RecordingEntry>& recordings, int viewers, double speed);
std::string session_text(const LiveSession& session, std::uint32_t epoch, HandMode mode);
/// 0: nobody.
std::string holder_text(int holder);
std::string mode_text(HandMode mode);
std::string building_text(const std::string& what);
std::string error_text(std::string_view code, const std::string& text, std::string_view about);
std::string log_text(const std::string& line);
std::string recording_text(bool on, const RecordingEntry& entry, double seconds);
std::string replay_text(bool on, const std::string& name);

} // namespace spherecut::app
