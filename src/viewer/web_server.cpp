#include "src/viewer/web_server.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cctype>
#include <deque>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace spherecut::app {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t header_bytes = 8192;
constexpr auto idle_patience = std::chrono::seconds(60);    // for a sign of life on a WebSocket
constexpr auto farewell_patience = std::chrono::seconds(5); // for the answer to a close
constexpr auto shutdown_patience = std::chrono::milliseconds(500);

constexpr std::string_view policy =
    "default-src 'self'; connect-src 'self' ws: wss:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "worker-src 'self' blob:; frame-ancestors 'none'";

std::string_view view(beast::string_view text) {
  return {text.data(), text.size()};
}

/// Bytes off the wire as a WebSocket may send them: a bucket that time fills. What never makes a message (frames
/// without content, messages without an end) empties it like any other; then nothing more is read.
class ByteBudget {
 public:
  /// From now on, per second; as many at once.
  void limit(double bytes) noexcept {
    rate_ = left_ = bytes;
    told_ = Clock::now();
  }
  [[nodiscard]] bool spent() const noexcept { return spent_; }

 private:
  friend class beast::rate_policy_access;
  static constexpr std::size_t all = std::numeric_limits<std::size_t>::max();
  std::size_t available_read_bytes() noexcept {
    if (rate_ <= 0)
      return all;
    const Clock::time_point now = Clock::now();
    left_ = std::min(rate_, left_ + rate_ * std::chrono::duration<double>(now - told_).count());
    told_ = now;
    return left_ >= 1 ? static_cast<std::size_t>(left_) : 0;
  }
  static std::size_t available_write_bytes() noexcept { return all; }
  void transfer_read_bytes(std::size_t count) noexcept {
    left_ -= static_cast<double>(count);
    spent_ = spent_ || (rate_ > 0 && left_ < 1); // there was more to read than it may send
  }
  void transfer_write_bytes(std::size_t /*count*/) noexcept {}
  void on_timer() noexcept {}

  double rate_ = 0; // 0: no limit
  double left_ = 0;
  bool spent_ = false; // once and for all
  Clock::time_point told_;
};

using Stream = beast::basic_stream<tcp, asio::any_io_executor, ByteBudget>;

} // namespace

struct WebServer::Data {
  struct Client;

  Data(WebServerOptions given, Handlers handed)
      : options(std::move(given)), handlers(std::move(handed)), acceptor(context), timer(context) {}

  void listen();
  void accept();
  void tick();
  void finish();

  WebServerOptions options;
  Handlers handlers;
  int port = 0;
  int connections = 0;
  int next_client = 1;
  bool stopping = false;
  std::map<int, std::shared_ptr<Client>> clients;
  asio::io_context context{1}; // what is pending goes with it, before the above
  tcp::acceptor acceptor;
  asio::steady_timer timer;
};

// One WebSocket. Held by its pending operations; `data->clients` has it while it is open.
struct WebServer::Data::Client : std::enable_shared_from_this<Client> {
  struct Message {
    std::string bytes;
    bool binary = false;
  };

  Client(Data& owner, int number, Stream stream)
      : data(owner), id(number), socket(std::move(stream)), tokens(owner.options.messages_per_second) {
    ++data.connections;
  }
  ~Client() { --data.connections; }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void open(const http::request<http::empty_body>& request) {
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = farewell_patience;
    timeout.idle_timeout = idle_patience;
    timeout.keep_alive_pings = true;
    socket.set_option(timeout);
    socket.set_option(websocket::stream_base::decorator(
        [](websocket::response_type& response) { response.set(http::field::server, "spherecut"); }));
    socket.read_message_max(data.options.message_bytes);
    socket.next_layer().rate_policy().limit(data.options.bytes_per_second);
    // Pings are answered without take_message(); they count like messages. In here nothing may be closed.
    socket.control_callback([this](websocket::frame_type, beast::string_view) {
      if (!spend(1))
        asio::post(socket.get_executor(), [self = shared_from_this()] { self->close(self->too_many()); });
    });
    socket.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error || self->data.stopping) {
        self->drop();
        return;
      }
      self->opened = true;
      if (self->data.handlers.opened)
        self->data.handlers.opened(self->id);
      self->read();
    });
  }

  void read() {
    socket.async_read(buffer, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error || self->gone) {
        self->drop();
        return;
      }
      self->take_message();
    });
  }

  /// Whether messages that cost so much are within the rate.
  bool spend(double cost) {
    const Clock::time_point now = Clock::now();
    tokens = std::min(data.options.messages_per_second,
                      tokens + data.options.messages_per_second * std::chrono::duration<double>(now - told).count());
    told = now;
    const bool within = tokens >= 1;
    tokens -= within ? cost : 0;
    return within;
  }
  [[nodiscard]] CloseReason too_many() const {
    return {CloseCode::policy, fmt::format("more than {:g} messages a second", data.options.messages_per_second)};
  }

  /// Ends a client that sends more bytes than it may, in whatever form.
  void check_bytes() {
    if (opened && !closing && socket.next_layer().rate_policy().spent())
      close({CloseCode::policy, fmt::format("more than {:g} bytes a second", data.options.bytes_per_second)});
  }

  void take_message() {
    std::optional<CloseReason> reason;
    if (!spend(1)) {
      reason = too_many();
    } else if (!socket.got_text()) {
      reason = CloseReason{CloseCode::unsupported, "binary messages are not taken"};
    } else {
      const auto bytes = buffer.cdata();
      reason = data.handlers.message(id, {static_cast<const char*>(bytes.data()), bytes.size()});
    }
    buffer.consume(buffer.size());
    if (reason)
      close(*reason);
    if (!closing && !gone)
      read();
  }

  void send(Message message) {
    if (gone || closing)
      return;
    if (message.binary)
      ++binary_waiting;
    else
      text_waiting += message.bytes.size();
    queue.push_back(std::move(message));
    if (text_waiting > data.options.text_bytes)
      close({CloseCode::policy, "messages are not read"});
    else if (!writing)
      write();
  }

  void write() {
    writing = true;
    socket.binary(queue.front().binary);
    socket.async_write(asio::buffer(queue.front().bytes),
                       [self = shared_from_this()](beast::error_code error, std::size_t) {
                         self->writing = false;
                         if (error || self->queue.empty()) {
                           self->drop();
                           return;
                         }
                         const Message& sent = self->queue.front();
                         if (sent.binary)
                           --self->binary_waiting;
                         else
                           self->text_waiting -= sent.bytes.size();
                         self->queue.pop_front();
                         if (!self->queue.empty() && !self->gone)
                           self->write();
                       });
  }

  // The client is forgotten at once; its socket goes when it has answered, or does not for a while.
  void close(const CloseReason& why) {
    if (closing || gone)
      return;
    if (!opened) { // its handshake is being answered: Beast cannot close what is not open
      drop();
      return;
    }
    closing = true;
    websocket::close_reason reason(static_cast<std::uint16_t>(why.code));
    reason.reason = beast::string_view(why.text).substr(0, 120);
    forget();
    while (queue.size() > (writing ? 1U : 0U)) // what is being written must stay where it is
      queue.pop_back();
    socket.async_close(reason, [self = shared_from_this()](beast::error_code) { self->drop(); });
  }

  void forget() {
    const bool was_open = std::exchange(opened, false);
    data.clients.erase(id);
    if (was_open && data.handlers.closed)
      data.handlers.closed(id);
  }

  void drop() {
    if (std::exchange(gone, true))
      return;
    const auto self = shared_from_this();
    forget();
    beast::error_code ignored;
    beast::get_lowest_layer(socket).socket().close(ignored);
  }

  Data& data;
  int id;
  websocket::stream<Stream> socket;
  beast::flat_buffer buffer;
  std::deque<Message> queue; // the front is being written
  std::size_t text_waiting = 0;
  int binary_waiting = 0;
  double tokens;
  Clock::time_point told = Clock::now();
  bool opened = false, writing = false, closing = false, gone = false;
};

namespace {

// One HTTP connection until it becomes a WebSocket.
struct HttpConnection : std::enable_shared_from_this<HttpConnection> {
  using Upgrade = std::function<void(Stream, const http::request<http::empty_body>&)>;

  HttpConnection(tcp::socket socket, const WebServerOptions& settings, const int& served_port, int& open_connections,
                 std::function<bool()> more_clients, Upgrade upgrade)
      : stream(std::move(socket)), options(settings), port(served_port), connections(open_connections),
        has_room(std::move(more_clients)), become(std::move(upgrade)) {
    ++connections;
  }
  ~HttpConnection() { --connections; }
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  void read() {
    parser.emplace();
    parser->header_limit(header_bytes);
    parser->body_limit(0);
    stream.expires_after(options.patience);
    http::async_read(stream, buffer, *parser, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error == http::error::header_limit)
        self->say(http::status::request_header_fields_too_large, "the request is too long", false);
      else if (error == http::error::body_limit)
        self->say(http::status::payload_too_large, "requests have no body here", false);
      else if (!error)
        self->answer();
      else if (error != http::error::end_of_stream &&
               error.category() == http::make_error_code(http::error::end_of_stream).category())
        self->say(http::status::bad_request, "this is not a request", false);
    });
  }

  void answer() {
    const http::request<http::empty_body>& request = parser->get();
    const std::string host(view(request[http::field::host]));
    const std::string origin(view(request[http::field::origin]));
    const bool keep = request.keep_alive();
    if (request.count(http::field::host) > 1 || request.count(http::field::origin) > 1)
      return say(http::status::bad_request, "one Host and one Origin", false);
    if (!host_allowed(host, options.address, port))
      return say(http::status::forbidden, "this name does not belong to this server", keep);
    const std::string_view target = view(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    if (websocket::is_upgrade(request)) {
      if (path != "/ws")
        return say(http::status::not_found, "the WebSocket is at /ws", keep);
      if (!origin_allowed(origin, host, options.address, port))
        return say(http::status::forbidden, "a page from elsewhere may not drive this session", keep);
      if (!has_room())
        return say(http::status::service_unavailable, fmt::format("{} viewers are here already", options.clients),
                   keep);
      const http::request<http::empty_body> taken = parser->release();
      stream.expires_never();
      return become(std::move(stream), taken);
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return say(http::status::method_not_allowed, "GET and HEAD alone", keep);
    if (path == "/ws")
      return say(http::status::upgrade_required, "a WebSocket is spoken here", keep);
    const std::optional<std::filesystem::path> file = options.file ? options.file(target) : std::nullopt;
    if (!file) {
      const bool page = path == "/" || path == "/index.html";
      return say(page ? http::status::service_unavailable : http::status::not_found,
                 page ? options.no_page : "there is no such file", keep);
    }
    send_file(*file, keep, request.method() == http::verb::head, target);
  }

  void send_file(const std::filesystem::path& file, bool keep, bool head, std::string_view target) {
    beast::error_code error;
    http::file_body::value_type body;
    body.open(file.c_str(), beast::file_mode::scan, error);
    if (error)
      return say(http::status::not_found, "there is no such file", keep);
    const std::uint64_t size = body.size();
    const auto set_headers = [&](auto& response) {
      response.set(http::field::content_type, std::string(content_type(file)));
      if (target.substr(0, 12) == "/recordings/")
        response.set(http::field::content_disposition, "attachment");
      decorate(response, keep);
      response.content_length(size);
    };
    if (head) {
      auto response = std::make_shared<http::response<http::empty_body>>(http::status::ok, 11);
      set_headers(*response);
      return send(std::move(response), keep);
    }
    auto response = std::make_shared<http::response<http::file_body>>(http::status::ok, 11);
    response->body() = std::move(body);
    set_headers(*response);
    send(std::move(response), keep);
  }

  void say(http::status status, const std::string& text, bool keep) {
    auto response = std::make_shared<http::response<http::string_body>>(status, 11);
    response->set(http::field::content_type, "text/plain; charset=utf-8");
    if (status == http::status::method_not_allowed)
      response->set(http::field::allow, "GET, HEAD");
    if (!(parser && parser->is_header_done() && parser->get().method() == http::verb::head))
      response->body() = text + "\n";
    decorate(*response, keep);
    response->prepare_payload();
    send(std::move(response), keep);
  }

  template <typename Response>
  static void decorate(Response& response, bool keep) {
    response.set(http::field::server, "spherecut");
    response.set(http::field::cache_control, "no-cache");
    response.set("Content-Security-Policy", beast::string_view(policy.data(), policy.size()));
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.keep_alive(keep);
  }

  /// An answer on its way.
  template <typename Response>
  struct Sending {
    explicit Sending(std::shared_ptr<Response> answer) : response(std::move(answer)), serializer(*response) {}
    std::shared_ptr<Response> response;
    http::response_serializer<typename Response::body_type> serializer;
  };

  template <typename Response>
  void send(std::shared_ptr<Response> response, bool keep) {
    send_on(std::make_shared<Sending<Response>>(std::move(response)), keep);
  }

  // Piece by piece: a client has its time for each of them, however long the whole takes.
  template <typename Response>
  void send_on(std::shared_ptr<Sending<Response>> sending, bool keep) {
    stream.expires_after(options.patience);
    auto& serializer = sending->serializer;
    http::async_write_some(stream, serializer,
                           [self = shared_from_this(), sending, keep](beast::error_code error, std::size_t) {
                             if (!error && !sending->serializer.is_done())
                               return self->send_on(sending, keep);
                             if (!error && keep)
                               return self->read();
                             beast::error_code ignored;
                             self->stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
                           });
  }

  Stream stream;
  beast::flat_buffer buffer{header_bytes + 4096};
  std::optional<http::request_parser<http::empty_body>> parser;
  const WebServerOptions& options;
  const int& port;
  int& connections;
  std::function<bool()> has_room;
  Upgrade become;
};

} // namespace

void WebServer::Data::listen() {
  beast::error_code error;
  const asio::ip::address ip = asio::ip::make_address(options.address, error);
  if (error)
    throw InputError(fmt::format("--address {}: this is not an IP address; 127.0.0.1 serves this machine alone, "
                                 "0.0.0.0 the whole network",
                                 options.address));
  if (options.port < 0 || options.port > 65535)
    throw InputError(fmt::format("--port {}: allowed: 0 (any free one) to 65535", options.port));
  const tcp::endpoint endpoint(ip, static_cast<std::uint16_t>(options.port));
  const auto fail = [&](const char* what) {
    if (error)
      throw InputError(fmt::format("cannot {} port {} of {}: {}{}", what, options.port, options.address,
                                   error.message(),
                                   error == asio::error::address_in_use ? "; give another one with --port" : ""));
  };
  acceptor.open(endpoint.protocol(), error);
  fail("open");
  acceptor.set_option(asio::socket_base::reuse_address(true), error);
  acceptor.bind(endpoint, error);
  fail("take");
  acceptor.listen(asio::socket_base::max_listen_connections, error);
  fail("listen at");
  port = acceptor.local_endpoint().port();
}

void WebServer::Data::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (stopping)
      return;
    if (!error && connections < options.connections) {
      beast::error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      const auto has_room = [this] { return static_cast<int>(clients.size()) < options.clients; };
      const auto become = [this](Stream stream, const http::request<http::empty_body>& request) {
        const int id = next_client++;
        const auto client = std::make_shared<Client>(*this, id, std::move(stream));
        clients.emplace(id, client);
        client->open(request);
      };
      std::make_shared<HttpConnection>(std::move(socket), options, port, connections, has_room, become)->read();
    }
    accept();
  });
}

void WebServer::Data::tick() {
  timer.expires_after(options.tick);
  timer.async_wait([this](beast::error_code error) {
    if (error || stopping)
      return;
    std::vector<std::shared_ptr<Client>> open; // to close one takes it out of the list
    for (const auto& [id, client] : clients)
      open.push_back(client);
    for (const auto& client : open)
      client->check_bytes();
    if (handlers.tick)
      handlers.tick();
    if (!stopping)
      tick();
  });
}

void WebServer::Data::finish() {
  stopping = true;
  beast::error_code ignored;
  acceptor.close(ignored);
  timer.cancel();
  std::vector<std::shared_ptr<Client>> open;
  for (const auto& [id, client] : clients)
    open.push_back(client);
  for (const auto& client : open)
    client->close({CloseCode::going_away, "the server ends"});
}

WebServer::WebServer(WebServerOptions options, Handlers handlers)
    : data_(std::make_unique<Data>(std::move(options), std::move(handlers))) {
  data_->listen();
}

WebServer::~WebServer() {
  // What is still pending belongs to the context and refers to the rest of the data: it must go first.
  data_->handlers = {};
  data_->stopping = true;
  for (const auto& [id, client] : std::exchange(data_->clients, {}))
    client->opened = false; // nobody is told any more
}

int WebServer::port() const {
  return data_->port;
}

void WebServer::run() {
  data_->accept();
  data_->tick();
  while (!data_->stopping)
    data_->context.run_one();
  data_->context.run_for(shutdown_patience);
}

void WebServer::stop() {
  if (!data_->stopping)
    data_->finish();
}

void WebServer::send_text(int client, std::string text) {
  if (const auto found = data_->clients.find(client); found != data_->clients.end())
    std::shared_ptr(found->second)->send({std::move(text), false});
}

void WebServer::send_binary(int client, std::string bytes) {
  if (const auto found = data_->clients.find(client); found != data_->clients.end())
    std::shared_ptr(found->second)->send({std::move(bytes), true});
}

int WebServer::waiting(int client) const {
  const auto found = data_->clients.find(client);
  return found != data_->clients.end() ? found->second->binary_waiting : 0;
}

void WebServer::charge(int client, double messages) {
  if (const auto found = data_->clients.find(client); found != data_->clients.end())
    found->second->tokens -= messages;
}

void WebServer::close(int client, const CloseReason& reason) {
  if (const auto found = data_->clients.find(client); found != data_->clients.end())
    std::shared_ptr(found->second)->close(reason);
}

} // namespace spherecut::app
