// A small live session, a server of it in a thread, and a viewer that reads what that sends byte by byte.
#pragma once

#include "src/viewer/hub.hpp"

#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/web_client.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

namespace spherecut::tests {

using Json = nlohmann::json;

/// A stretched block with a ball and a blade to hold, about 150 nodes.
inline const std::string live_block = "title = \"live\"\n" + block_organ + R"(pretension = [0.05, 0.0, 0.0]
[[fixed]]
name = "sides"
region = "half_space"
point = [-0.029, 0, 0]
normal = [1, 0, 0]
[[fixed]]
name = "other side"
region = "half_space"
point = [0.029, 0, 0]
normal = [-1, 0, 0]
[nodes]
fine_spacing = 0.007
coarse_spacing = 0.014
fine_radius = 0.008
)" + replaced(ball_tool, "0.001", "0.005") +
                                      R"([blade]
edge = [[0, 0, 0], [0, 0, 0.03]]
edge_radius = 1e-4
[[blade.path]]
time = 0
position = [0, -0.05, 0.02]
[[blade.path]]
time = 1
position = [0, -0.04, 0.02]
[haptics]
budget = 5.0
[output]
figures = false
)";

/// A hub on a server of its own, driven by a thread.
class Served {
 public:
  explicit Served(const std::string& text = live_block, const std::filesystem::path& recordings = {}) {
    app::HubOptions settings;
    settings.scenario = write_file(folder_.path() / "live.toml", text);
    settings.recordings = recordings.empty() ? folder_.path() / "recordings" : recordings;
    write_file(folder_.path() / "bad.toml", replaced(text, "young_modulus = 1e4", "young_modulus = -1"));
    hub_ = std::make_unique<app::Hub>(settings, [](const std::string&) {});
    app::WebServerOptions options;
    options.port = 0;
    app::WebServer::Handlers handlers;
    handlers.opened = [this](int client) { hub_->opened(client); };
    handlers.message = [this](int client, std::string_view what) { return hub_->message(client, what); };
    handlers.closed = [this](int client) { hub_->closed(client); };
    handlers.tick = [this] {
      hub_->tick();
      if (stop_)
        server_->stop();
    };
    server_ = std::make_unique<app::WebServer>(options, handlers);
    hub_->attach(*server_);
    thread_ = std::thread([this] { server_->run(); });
  }
  ~Served() {
    stop_ = true;
    thread_.join();
    server_.reset();
    hub_.reset();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;
  [[nodiscard]] int port() const { return server_->port(); }
  [[nodiscard]] const TemporaryFolder& folder() const { return folder_; }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<app::Hub> hub_;
  std::unique_ptr<app::WebServer> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// What a page knows, read from the bytes as docs/viewer_protocol.md has them.
class Viewer {
 public:
  explicit Viewer(int port, int version = 2) : version_(version), socket_(port) {
    say({{"type", "hello"}, {"version", version}});
    say({{"type", "credit"}, {"frames", 2}});
  }
  void say(const Json& message) { socket_.send(message.dump()); }
  void pose(const Vector3& at) { say({{"type", "pose"}, {"n", ++number}, {"position", {at.x(), at.y(), at.z()}}}); }
  void pose_second(const Vector3& at) {
    say({{"type", "pose"}, {"n", ++number}, {"hand", 2}, {"position", {at.x(), at.y(), at.z()}}});
  }
  /// Takes messages until the condition holds.
  template <typename Condition>
  bool until(const Condition& condition, double seconds = 60) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!condition()) {
      const auto message = socket_.receive(1);
      if ((!message && !socket_.open()) || std::chrono::steady_clock::now() > end)
        return false;
      if (message)
        take(*message);
    }
    return true;
  }
  [[nodiscard]] Vector3 vector(std::size_t offset) const {
    return {value<float>(offset), value<float>(offset + 4), value<float>(offset + 8)};
  }
  template <typename T>
  [[nodiscard]] T value(std::size_t offset) const {
    T result;
    std::memcpy(&result, frame.data() + offset, sizeof result);
    return result;
  }
  /// Data of a section of a message; empty: it has none.
  static std::string section(const std::string& bytes, std::uint32_t kind) {
    std::uint16_t start = 0;
    std::memcpy(&start, bytes.data() + 2, 2);
    for (std::size_t at = start; at + 8 <= bytes.size();) {
      std::uint32_t found = 0;
      std::uint32_t length = 0;
      std::memcpy(&found, bytes.data() + at, 4);
      std::memcpy(&length, bytes.data() + at + 4, 4);
      if (found == kind)
        return bytes.substr(at + 8, length);
      at += 8 + (length + 3) / 4 * 4;
    }
    return {};
  }

  std::uint32_t number = 0;
  Json welcome, session, holder, mode, second, recording, replay;
  std::vector<Json> errors;
  std::string topology, frame, picture; // the newest; picture: the newest frame with vertices
  int topologies = 0, frames = 0, pictures = 0;
  bool sound = true; // every header told its length

 private:
  void take(const WebMessage& message) {
    if (!message.binary) {
      const Json json = Json::parse(message.bytes);
      const std::string type = json["type"];
      if (type == "error")
        errors.push_back(json);
      for (const auto& [name, place] : {std::pair<const char*, Json*>{"welcome", &welcome},
                                        {"session", &session},
                                        {"holder", &holder},
                                        {"mode", &mode},
                                        {"second", &second},
                                        {"recording", &recording},
                                        {"replay", &replay}})
        if (type == name)
          *place = json;
      return;
    }
    std::uint32_t length = 0;
    std::memcpy(&length, message.bytes.data() + 4, 4);
    sound = sound && length == message.bytes.size() && message.bytes[1] == version_;
    if (message.bytes[0] == 1) {
      topology = message.bytes;
      ++topologies;
      return;
    }
    frame = message.bytes;
    ++frames;
    if (!section(frame, 16).empty()) {
      picture = frame;
      ++pictures;
    }
    say({{"type", "credit"}, {"frames", 1}});
  }
  int version_; // of the protocol
  WebSocketClient socket_;
};

/// Of the tissue on the tool in the first hand, N.
inline double force_of(const Viewer& viewer) {
  return viewer.frame.empty() ? 0 : viewer.vector(116).norm();
}

} // namespace spherecut::tests
