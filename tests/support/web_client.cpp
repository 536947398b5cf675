#include "tests/support/web_client.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>

namespace spherecut::tests {
namespace {

namespace beast = boost::beast;
using boost::asio::ip::tcp;

std::string host_of(const std::string& host, int port) {
  return host.empty() ? "127.0.0.1:" + std::to_string(port) : host;
}

tcp::endpoint endpoint_of(int port) {
  return {boost::asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(port)};
}

} // namespace

HttpAnswer http_request(int port, const std::string& target, const std::string& host, const std::string& method,
                        const std::string& more_headers) {
  boost::asio::io_context context;
  tcp::socket socket(context);
  socket.connect(endpoint_of(port));
  const std::string request = method + " " + target + " HTTP/1.1\r\nHost: " + host_of(host, port) + "\r\n" +
                              (more_headers.empty() ? "Connection: close\r\n" : more_headers) + "\r\n";
  boost::asio::write(socket, boost::asio::buffer(request));
  beast::flat_buffer buffer;
  beast::http::response_parser<beast::http::string_body> parser;
  parser.skip(method == "HEAD");
  beast::error_code error;
  beast::http::read(socket, buffer, parser, error);
  if (error && error != beast::http::error::end_of_stream)
    return {};
  const beast::http::response<beast::http::string_body> response = parser.release();
  return {static_cast<int>(response.result_int()), response.body(),
          std::string(response[beast::http::field::content_type].data(),
                      response[beast::http::field::content_type].size())};
}

struct WebSocketClient::Data {
  boost::asio::io_context context;
  beast::websocket::stream<tcp::socket> socket{context};
  beast::flat_buffer buffer;
  bool open = false, reading = false, arrived = false;
  int status = 0, close_code = 0;
};

WebSocketClient::WebSocketClient(int port, const std::string& origin, const std::string& host)
    : data_(std::make_unique<Data>()) {
  data_->socket.next_layer().connect(endpoint_of(port));
  data_->socket.set_option(beast::websocket::stream_base::decorator([origin](beast::websocket::request_type& request) {
    if (!origin.empty())
      request.set(beast::http::field::origin, origin);
  }));
  data_->socket.read_message_max(std::size_t{64} << 20U);
  beast::error_code error;
  data_->socket.handshake(host_of(host, port), "/ws", error);
  data_->open = !error;
  if (error) // the stream keeps the answer to itself: ask once more
    data_->status = http_request(port, "/ws", host, "GET",
                                 "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
                                     (origin.empty() ? std::string() : "Origin: " + origin + "\r\n"))
                        .status;
}

WebSocketClient::~WebSocketClient() = default;

bool WebSocketClient::open() const {
  return data_->open;
}

int WebSocketClient::status() const {
  return data_->status;
}

int WebSocketClient::close_code() const {
  return data_->close_code;
}

void WebSocketClient::send(const std::string& text) {
  beast::error_code error;
  data_->socket.text(true);
  data_->socket.write(boost::asio::buffer(text), error);
}

void WebSocketClient::send_binary(const std::string& bytes) {
  beast::error_code error;
  data_->socket.binary(true);
  data_->socket.write(boost::asio::buffer(bytes), error);
}

void WebSocketClient::ping() {
  beast::error_code error;
  data_->socket.ping({}, error);
}

bool WebSocketClient::send_raw(const std::string& bytes) {
  beast::error_code error;
  boost::asio::write(data_->socket.next_layer(), boost::asio::buffer(bytes), error);
  return !error;
}

std::optional<WebMessage> WebSocketClient::receive(double seconds) {
  if (!data_->open)
    return std::nullopt;
  if (!data_->reading) {
    data_->reading = true;
    data_->arrived = false;
    data_->buffer.consume(data_->buffer.size());
    data_->socket.async_read(data_->buffer, [this](beast::error_code error, std::size_t) {
      data_->arrived = true;
      if (!error)
        return;
      data_->open = false;
      data_->close_code =
          error == beast::websocket::error::closed ? static_cast<int>(data_->socket.reason().code) : 1006;
    });
  }
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  data_->context.restart();
  while (!data_->arrived && std::chrono::steady_clock::now() < until)
    data_->context.run_one_until(std::chrono::time_point_cast<std::chrono::steady_clock::duration>(until));
  if (!data_->arrived)
    return std::nullopt;
  data_->reading = false;
  if (!data_->open)
    return std::nullopt;
  return WebMessage{!data_->socket.got_text(), beast::buffers_to_string(data_->buffer.data())};
}

bool WebSocketClient::wait_for_close(double seconds) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (data_->open && std::chrono::steady_clock::now() < until)
    static_cast<void>(receive(std::chrono::duration<double>(until - std::chrono::steady_clock::now()).count()));
  return !data_->open;
}

} // namespace spherecut::tests
