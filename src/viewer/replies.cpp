#include "src/viewer/replies.hpp"

#include "src/base/version.hpp"
#include "src/model/body_model.hpp"
#include "topology/base/overloaded.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace spherecut::app {
namespace {

using Json = nlohmann::json;

constexpr std::size_t list_bytes =
    90'000; // of a list: two of them and the session fit into WebServerOptions::text_bytes

std::string_view name_of(HandMode mode) {
  switch (mode) {
  case HandMode::blade:
    return "blade";
  case HandMode::grasper:
    return "grasper";
  case HandMode::usual:
  case HandMode::probe:
    break;
  }
  return "probe";
}

Json array_of(const Vector3& x) {
  return {x.x(), x.y(), x.z()};
}

Json tool_of(const Scenario& scenario) {
  if (!scenario.tool)
    return nullptr;
  return std::visit(
      topology::Overloaded{[](const topology::SphereTip& ball) -> Json {
                             return {{"shape", "sphere"}, {"radius", ball.radius}};
                           },
                           [](const topology::FlatPunch& punch) -> Json {
                             return {{"shape", "punch"}, {"radius", punch.radius}, {"length", punch.length}};
                           },
                           [](const topology::Laparoscope& instrument) -> Json {
                             return {{"shape", "laparoscope"},
                                     {"radius", instrument.tip_radius},
                                     {"shaft_radius", instrument.shaft_radius},
                                     {"shaft_length", instrument.shaft_length},
                                     {"port", array_of(instrument.port)}};
                           }},
      scenario.tool->shape);
}

Json blade_of(const Scenario& scenario) {
  if (!scenario.blade)
    return nullptr;
  Json edge = Json::array();
  for (const Vector3& x : scenario.blade->edge)
    edge.push_back(array_of(x));
  return {{"edge", edge}};
}

/// Text that is not UTF-8 (of a file's name) is shown as far as it is.
std::string dumped(const Json& message) {
  return message.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Takes entries off the end of a list until a client may be sent it. Returns how many.
std::size_t shorten(Json& list) {
  std::size_t bytes = 0, kept = 0;
  for (; kept < list.size(); ++kept)
    if ((bytes += dumped(list[kept]).size()) > list_bytes)
      break;
  const std::size_t left_out = list.size() - kept;
  list.erase(list.begin() + static_cast<Json::difference_type>(kept), list.end());
  return left_out;
}

} // namespace

std::string welcome_text(int client, int spoken, WelcomeLists lists, int viewers, double speed) {
  Json list = Json::array();
  for (const ScenarioEntry& entry : lists.scenarios)
    list.push_back({{"name", entry.name}, {"title", entry.title}});
  Json records = Json::array();
  for (const RecordingEntry& entry : lists.recordings)
    records.push_back({{"name", entry.name}, {"bytes", entry.bytes}, {"url", "/recordings/" + entry.name}});
  lists.scenarios_left_out += shorten(list);
  lists.recordings_left_out += shorten(records);
  return dumped({{"type", "welcome"},
                 {"version", spoken},
                 {"id", client},
                 {"server", fmt::format("spherecut {}", version())},
                 {"scenarios", list},
                 {"scenarios_left_out", lists.scenarios_left_out},
                 {"recordings", records},
                 {"recordings_left_out", lists.recordings_left_out},
                 {"limits",
                  {{"message_bytes", WebServerOptions{}.message_bytes},
                   {"messages_per_second", WebServerOptions{}.messages_per_second},
                   {"bytes_per_second", WebServerOptions{}.bytes_per_second},
                   {"credit", most_credit},
                   {"viewers", viewers},
                   {"speed", speed}}}});
}

std::string session_text(const LiveSession& session, std::uint32_t epoch, HandMode mode) {
  const Scenario& scenario = session.scenario();
  const BoundingBox box = session.domain().bounds();
  Json modes = Json::array();
  Json park = Json::object();
  for (const HandMode each : session.places().modes()) {
    modes.push_back(name_of(each));
    park[std::string(name_of(each))] = array_of(session.places().parked(each).position);
  }
  const std::string title = scenario.title.empty() ? scenario.file.stem().string() : scenario.title;
  return dumped({{"type", "session"},
                 {"epoch", epoch},
                 {"scenario", scenario.file.filename().string()},
                 {"title", title},
                 {"bounds", {{"lower", array_of(box.lower)}, {"upper", array_of(box.upper)}}},
                 {"triangles", session.domain().surface().triangles.size()},
                 {"nodes", session.nodes()},
                 {"modes", modes},
                 {"mode", name_of(mode)},
                 {"two_hands", session.takes_two_hands()},
                 {"tool", tool_of(scenario)},
                 {"blade", blade_of(scenario)},
                 {"park", park},
                 {"spring", scenario.haptics.hand.stiffness},
                 {"settings",
                  {{"young_modulus", scenario.material.young_modulus},
                   {"poisson_ratio", scenario.material.poisson_ratio},
                   {"toughness", scenario.toughness},
                   {"method", solvers::to_string(scenario.method.method)},
                   {"sight", solvers::to_string(sight_of(scenario))},
                   {"fine_spacing", session.fine_spacing()},
                   {"coarse_spacing", session.coarse_spacing()}}}});
}

std::string holder_text(int holder) {
  return dumped({{"type", "holder"}, {"id", holder > 0 ? Json(holder) : Json(nullptr)}});
}

std::string mode_text(HandMode mode) {
  return dumped({{"type", "mode"}, {"mode", name_of(mode)}});
}

std::string second_text(bool on) {
  return dumped({{"type", "second"}, {"on", on}});
}

std::string building_text(const std::string& what) {
  return dumped({{"type", "building"}, {"what", what}});
}

std::string error_text(std::string_view code, const std::string& text, std::string_view about) {
  return dumped({{"type", "error"}, {"code", code}, {"text", text}, {"about", about}});
}

std::string log_text(const std::string& line) {
  const bool warns = line.rfind("warning: ", 0) == 0;
  return dumped({{"type", "log"}, {"level", warns ? "warning" : "info"}, {"text", warns ? line.substr(9) : line}});
}

std::string recording_text(bool on, const RecordingEntry& entry, double seconds) {
  return dumped({{"type", "recording"},
                 {"on", on},
                 {"name", entry.name},
                 {"seconds", seconds},
                 {"bytes", entry.bytes},
                 {"url", "/recordings/" + entry.name}});
}

std::string tear_text(const TearStatus& tear) {
  return dumped({{"type", "tear"}, {"state", to_string(tear.state)}, {"text", tear.reason}, {"area", tear.area}});
}

std::string replay_text(bool on, const std::string& name) {
  return dumped({{"type", "replay"}, {"name", name}, {"on", on}});
}

} // namespace spherecut::app
