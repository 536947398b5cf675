// Files over HTTP and messages over a WebSocket on one port (Boost.Beast, in the .cpp). Everything but run()'s start
// happens on the thread that calls run(); handlers are called there and may call back.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace spherecut::app {

/// Reasons for the end of a WebSocket [RFC 6455, 7.4.1].
enum class CloseCode : std::uint16_t { going_away = 1001, unsupported = 1003, invalid = 1007, policy = 1008 };

struct CloseReason {
  CloseCode code = CloseCode::invalid;
  std::string text; // at most 120 bytes are sent
};

struct WebServerOptions {
  std::string address = "127.0.0.1"; // an IP address
  int port = 8080;                   // 0: any free one
  /// File of a path of the URL ("/", "/assets/page.js"), or empty: there is none. What it gives must be safe to serve.
  std::function<std::optional<std::filesystem::path>(std::string_view path)> file;
  std::string no_page;                       // what a GET of the page says when file("/") gives nothing
  std::size_t message_bytes = 4096;          // longest message taken: none of the protocol is half as long
  double bytes_per_second = 131072;          // off the wire of a WebSocket, in whatever frames; as many at once
  double messages_per_second = 300;          // per client; as many at once
  std::size_t text_bytes = 256 * 1024;       // text that may wait for a client that does not read
  int clients = 16;                          // WebSockets at a time
  int connections = 64;                      // of all kinds
  std::chrono::milliseconds tick{8};         // between two calls of Handlers::tick
  std::chrono::milliseconds patience{15000}; // for an HTTP request, and for each piece of its answer
};

class WebServer {
 public:
  struct Handlers {
    std::function<void(int client)> opened;
    /// A text message; a reason ends that client.
    std::function<std::optional<CloseReason>(int client, std::string_view text)> message;
    std::function<void(int client)> closed;
    std::function<void()> tick; // every WebServerOptions::tick
  };

  /// Listens. Throws InputError when the address is not one or the port cannot be had.
  WebServer(WebServerOptions options, Handlers handlers);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] int port() const;

  /// Serves until stop() is called from a handler; then tells the clients and returns within a second.
  void run();
  void stop();

  /// Queues text for a client; too much of it waiting ends the client.
  void send_text(int client, std::string text);
  /// Takes parts of one binary message. Only while nothing binary waits (see waiting()).
  void send_binary(int client, std::string bytes);
  /// Binary messages of a client that are not written to its socket yet.
  [[nodiscard]] int waiting(int client) const;
  /// What a message has cost beyond one, in messages: work counts like the number of them.
  void charge(int client, double messages);
  void close(int client, const CloseReason& reason);

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

/// File below `folder` that a URL's path names: decoded, without "..", hidden names, backslashes, control characters or
/// links that lead out. Empty when there is none.
std::optional<std::filesystem::path> file_below(const std::filesystem::path& folder, std::string_view path);

/// Content type by the name's extension; application/octet-stream for others.
std::string_view content_type(const std::filesystem::path& file);

/// Whether a request with this Host, and Origin (empty: none), may be answered by a server at this address and port.
/// A name that somebody else's DNS points here is refused, and so is the page of another server.
bool host_allowed(std::string_view host, std::string_view address, int port);
bool origin_allowed(std::string_view origin, std::string_view host, std::string_view address, int port);

} // namespace spherecut::app
