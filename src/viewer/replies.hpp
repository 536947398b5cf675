// JSON messages of the server to its viewers, as docs/viewer_protocol.md has them.
#pragma once

#include "src/viewer/requests.hpp"
#include "src/viewer/web_server.hpp"

namespace spherecut::app {

struct ScenarioEntry {
  std::string name, title;
};
struct RecordingEntry {
  std::string name;
  std::uint64_t bytes = 0;
};

/// What there is to choose from, as far as it is told.
struct WelcomeLists {
  std::vector<ScenarioEntry> scenarios;
  std::vector<RecordingEntry> recordings;
  std::size_t scenarios_left_out = 0, recordings_left_out = 0;
};

/// Lists too long for a client to be sent at once lose their last entries, which count as left out.
/// `spoken`: version of the protocol, the client's.
std::string welcome_text(int client, int spoken, WelcomeLists lists, int viewers, double speed);
std::string session_text(const LiveSession& session, std::uint32_t epoch, HandMode mode);
/// 0: nobody.
std::string holder_text(int holder);
std::string mode_text(HandMode mode);
/// Whether the second hand has the blade.
std::string second_text(bool on);
std::string building_text(const std::string& what);
std::string error_text(std::string_view code, const std::string& text, std::string_view about);
std::string log_text(const std::string& line);
std::string recording_text(bool on, const RecordingEntry& entry, double seconds);
std::string tear_text(const TearStatus& tear);
std::string replay_text(bool on, const std::string& name);

} // namespace spherecut::app
