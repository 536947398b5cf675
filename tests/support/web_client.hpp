// A web client for tests: one request, or a WebSocket with receives that do not wait for ever.
#pragma once

#include <memory>
#include <optional>
#include <string>

namespace spherecut::tests {

struct HttpAnswer {
  int status = 0;
  std::string body, type; // type: Content-Type
};

/// One request to 127.0.0.1, its target sent as it is. Empty host: 127.0.0.1:port.
HttpAnswer http_request(int port, const std::string& target, const std::string& host = {},
                        const std::string& method = "GET", const std::string& more_headers = {});

struct WebMessage {
  bool binary = false;
  std::string bytes;
};

class WebSocketClient {
 public:
  /// Connects to /ws on 127.0.0.1; open() says whether it was let in. Empty origin: none is sent.
  explicit WebSocketClient(int port, const std::string& origin = {}, const std::string& host = {});
  ~WebSocketClient();
  WebSocketClient(const WebSocketClient&) = delete;
  WebSocketClient& operator=(const WebSocketClient&) = delete;

  [[nodiscard]] bool open() const;
  /// HTTP status of a refused handshake.
  [[nodiscard]] int status() const;
  /// Code of the close that has come; 0: none, 1006: the connection went without one.
  [[nodiscard]] int close_code() const;

  void send(const std::string& text);
  void send_binary(const std::string& bytes);
  void ping();
  /// Bytes as they are, past the protocol; false: the connection takes no more.
  bool send_raw(const std::string& bytes);
  /// The next message; none within the time, or when the connection has ended.
  std::optional<WebMessage> receive(double seconds = 30);
  /// Receives until the connection ends; false: not within the time.
  bool wait_for_close(double seconds = 30);

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

} // namespace spherecut::tests
