// The web server alone, with a client of its own: what is served, who is let in, and what a client can do to it.
#include "src/viewer/requests.hpp"
#include "src/viewer/web_server.hpp"

#include "tests/support/temporary_folder.hpp"
#include "tests/support/web_client.hpp"
#include "topology/base/errors.hpp"

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <mutex>
#include <thread>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

/// A server with a page of two files that answers "echo" with the same text, ends a client at "bad", and sends 100 kB
/// a tick to a client that has said "flood", when nothing waits for it.
class TestServer {
 public:
  explicit TestServer(WebServerOptions options = {}) {
    std::ofstream(folder_.path() / "index.html") << "<p>page</p>";
    std::filesystem::create_directory(folder_.path() / "assets");
    std::ofstream(folder_.path() / "assets" / "page.js") << "let a = 1;";
    std::ofstream(folder_.path() / ".secret") << "secret";
    std::filesystem::create_symlink("/etc/passwd", folder_.path() / "link.txt");
    std::filesystem::create_directory_symlink("/etc", folder_.path() / "folder");
    options.port = 0;
    options.file = [this](std::string_view path) { return file_below(folder_.path(), path); };
    WebServer::Handlers handlers;
    handlers.opened = [this](int) { ++opened; };
    handlers.closed = [this](int client) {
      ++closed;
      flooded_.erase(std::remove(flooded_.begin(), flooded_.end(), client), flooded_.end());
    };
    handlers.message = [this](int client, std::string_view text) -> std::optional<CloseReason> {
      try {
        static_cast<void>(parse_request(text)); // as the session reads it
      } catch (const InputError&) {
        ++refused;
      }
      if (text == "bad")
        return CloseReason{CloseCode::invalid, "this is bad"};
      if (text == "dear") {
        ++dear;
        server_->charge(client, 1000);
      }
      if (text == "flood")
        flooded_.push_back(client);
      if (text == "talk")
        for (int i = 0; i < 4000; ++i)
          server_->send_text(client, std::string(1000, 'x'));
      server_->send_text(client, std::string(text));
      return std::nullopt;
    };
    handlers.tick = [this] {
      for (const int client : flooded_)
        if (server_->waiting(client) == 0) {
          server_->send_binary(client, std::string(100'000, 'b'));
          ++floods;
        }
      if (stop_)
        server_->stop();
    };
    server_ = std::make_unique<WebServer>(std::move(options), std::move(handlers));
    thread_ = std::thread([this] { server_->run(); });
  }
  ~TestServer() {
    stop_ = true;
    thread_.join();
  }
  TestServer(const TestServer&) = delete;
  TestServer& operator=(const TestServer&) = delete;

  [[nodiscard]] int port() const { return server_->port(); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_.path() / name) << text; }
  std::atomic<int> opened{0}, closed{0}, refused{0}, floods{0}, dear{0};

 private:
  TemporaryFolder folder_;
  std::vector<int> flooded_; // the server's thread alone
  std::unique_ptr<WebServer> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A GET that reads a million bytes at a time, asked before each whether to go on; true: all of the body came.
bool slow_download(int port, const std::string& target, const std::function<bool(std::size_t)>& go_on) {
  boost::asio::io_context context;
  boost::asio::ip::tcp::socket socket(context);
  socket.open(boost::asio::ip::tcp::v4());
  socket.set_option(boost::asio::socket_base::receive_buffer_size(65536));
  socket.connect({boost::asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(port)});
  const std::string request =
      "GET " + target + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\nConnection: close\r\n\r\n";
  boost::asio::write(socket, boost::asio::buffer(request));
  std::string head;
  boost::system::error_code error;
  const std::size_t head_size = boost::asio::read_until(socket, boost::asio::dynamic_buffer(head), "\r\n\r\n", error);
  if (error)
    return false;
  const std::size_t length = std::stoul(head.substr(head.find("Content-Length: ") + 16));
  std::size_t taken = head.size() - head_size;
  std::vector<char> block(1'000'000);
  while (taken < length && go_on(taken)) {
    taken +=
        boost::asio::read(socket, boost::asio::buffer(block.data(), std::min(block.size(), length - taken)), error);
    if (error)
      return false;
  }
  go_on(taken);
  return taken == length;
}

/// Targets that lead out of the folder of the page, to what is hidden in it, or nowhere.
constexpr std::array<std::string_view, 53> escapes{"/../etc/passwd",
                                                   "/../../../../../../../../etc/passwd",
                                                   "/assets/../../etc/passwd",
                                                   "/assets/../index.html",
                                                   "/assets/..",
                                                   "/..",
                                                   "/.",
                                                   "/...",
                                                   "/.../index.html",
                                                   "/./index.html",
                                                   "/assets/./page.js",
                                                   "/%2e%2e/etc/passwd",
                                                   "/%2E%2E/etc/passwd",
                                                   "/.%2e/etc/passwd",
                                                   "/%2e./etc/passwd",
                                                   "/..%2f..%2fetc/passwd",
                                                   "/%2e%2e%2fetc%2fpasswd",
                                                   "/assets%2f..%2f..%2fetc%2fpasswd",
                                                   "/%252e%252e/etc/passwd",
                                                   "/%25252e%25252e/etc/passwd",
                                                   "/%c0%ae%c0%ae/etc/passwd",
                                                   "/%e0%80%ae%e0%80%ae/etc/passwd",
                                                   "/%u002e%u002e/etc/passwd",
                                                   "/..%c0%afetc/passwd",
                                                   "/..\\..\\etc\\passwd",
                                                   "/..%5c..%5cetc%5cpasswd",
                                                   "/..\\index.html",
                                                   "/assets\\page.js",
                                                   "/c:/index.html",
                                                   "/index.html::$DATA",
                                                   "//etc/passwd",
                                                   "///index.html",
                                                   "//index.html",
                                                   "/assets//page.js",
                                                   "/%2findex.html",
                                                   "/%2fetc%2fpasswd",
                                                   "/assets/",
                                                   "/assets",
                                                   "/index.html/",
                                                   "/index.html/..",
                                                   "/.secret",
                                                   "/%2esecret",
                                                   "/assets/../.secret",
                                                   "/link.txt",
                                                   "/folder/passwd",
                                                   "/folder/../index.html",
                                                   "/a%00b",
                                                   "/index.html%00.png",
                                                   "/index.html%0a",
                                                   "/index.html%7f",
                                                   "/%zz",
                                                   "http://127.0.0.1/etc/passwd",
                                                   "file:///etc/passwd"};

/// What the header Host may hold from a browser that another's DNS has brought here, or from a program that tries; PORT
/// stands for the port that is served. All of it is refused by a server of the loopback address.
constexpr std::array<std::string_view, 40> strange_hosts{"evil.example",
                                                         "evil.example:PORT",
                                                         "evil.example:80",
                                                         "127.0.0.1",
                                                         "127.0.0.1:",
                                                         "127.0.0.1:1",
                                                         "127.0.0.1:0",
                                                         "127.0.0.1:-PORT",
                                                         "127.0.0.1:+PORT",
                                                         "127.0.0.1:0xPORT",
                                                         "127.0.0.1:PORTPORT",
                                                         "127.0.0.1:PORT:PORT",
                                                         "127.0.0.1:PORT.evil.example",
                                                         "127.0.0.1:PORT@evil.example",
                                                         "127.0.0.1:99999999999999999999",
                                                         "127.0.0.1.:PORT",
                                                         "127.0.0.1.evil.example:PORT",
                                                         "127.0.0.1@evil.example:PORT",
                                                         "evil.example@127.0.0.1:PORT",
                                                         "evil.example#127.0.0.1:PORT",
                                                         "127.0.0.1/evil.example:PORT",
                                                         "http://127.0.0.1:PORT",
                                                         "127.0.0.2:PORT",
                                                         "127.1:PORT",
                                                         "2130706433:PORT",
                                                         "0x7f.0.0.1:PORT",
                                                         "0177.0.0.1:PORT",
                                                         "0.0.0.0:PORT",
                                                         "10.0.0.7:PORT",
                                                         "localhost",
                                                         "localhost.:PORT",
                                                         "localhost.evil.example:PORT",
                                                         "local host:PORT",
                                                         "[::1",
                                                         "[::1]PORT",
                                                         "[::1]x:PORT",
                                                         "[::]:PORT",
                                                         "[::ffff:127.0.0.1]:PORT",
                                                         "::1:PORT",
                                                         ":PORT"};

/// The same of the header Origin of a page that wants to drive the session.
constexpr std::array<std::string_view, 28> strange_origins{"http://evil.example",
                                                           "http://evil.example:PORT",
                                                           "https://127.0.0.1:PORT",
                                                           "HTTPS://localhost:PORT",
                                                           "ws://127.0.0.1:PORT",
                                                           "file://",
                                                           "null",
                                                           "127.0.0.1:PORT",
                                                           "//127.0.0.1:PORT",
                                                           "http:127.0.0.1:PORT",
                                                           "http:/127.0.0.1:PORT",
                                                           "http://",
                                                           "http://127.0.0.1",
                                                           "http://127.0.0.1:1",
                                                           "http://127.0.0.1:PORT0",
                                                           "http://127.0.0.1:PORT/page",
                                                           "http://127.0.0.1:PORT@evil.example",
                                                           "http://127.0.0.1:PORT.evil.example",
                                                           "http://127.0.0.1.evil.example:PORT",
                                                           "http://evil.example@127.0.0.1:PORT",
                                                           "http://evil.example#127.0.0.1:PORT",
                                                           "http://127.0.0.2:PORT",
                                                           "http://10.0.0.7:PORT",
                                                           "http://0.0.0.0:PORT",
                                                           "http://localhost.evil.example:PORT",
                                                           "http://localhost:PORT http://evil.example",
                                                           "chrome-extension://abcdef",
                                                           "http://[::1]:PORT.evil.example"};

/// With PORT replaced.
std::string at_port(std::string_view text, const std::string& port) {
  std::string result(text);
  for (std::size_t at = result.find("PORT"); at != std::string::npos; at = result.find("PORT", at + port.size()))
    result.replace(at, 4, port);
  return result;
}

bool echoes(WebSocketClient& client) {
  client.send("echo");
  const auto answer = client.receive();
  return answer && answer->bytes == "echo";
}

template <typename Condition>
bool soon(const Condition& condition) {
  for (int i = 0; i < 1000; ++i) {
    if (condition())
      return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

} // namespace

TEST_CASE("The page is served with its types, and nothing beside it") {
  const TestServer server;
  const HttpAnswer page = http_request(server.port(), "/");
  CHECK(page.status == 200);
  CHECK(page.body == "<p>page</p>");
  CHECK(page.type == "text/html; charset=utf-8");
  CHECK(http_request(server.port(), "/assets/page.js?v=1").body == "let a = 1;");
  CHECK(http_request(server.port(), "/assets/page.js").type == "text/javascript; charset=utf-8");
  const HttpAnswer head = http_request(server.port(), "/", {}, "HEAD");
  CHECK(head.status == 200);
  CHECK(head.body.empty());
  CHECK(http_request(server.port(), "/nothing.js").status == 404);
  CHECK(http_request(server.port(), "/", {}, "POST").status == 405);
  STATIC_REQUIRE(escapes.size() >= 47);
  for (const std::string_view escape : escapes) {
    CAPTURE(escape);
    const HttpAnswer answer = http_request(server.port(), std::string(escape));
    CHECK((answer.status == 404 || answer.status == 400)); // 400: no target at all
    CHECK(answer.body.find("secret") == std::string::npos);
    CHECK(answer.body.find("root:") == std::string::npos);
  }
  CHECK(http_request(server.port(), "/" + std::string(9000, 'a')).status == 431);
}

TEST_CASE("Hosts that another's DNS points here and pages from elsewhere are refused") {
  const TestServer server;
  const std::string port = std::to_string(server.port());
  STATIC_REQUIRE(strange_hosts.size() >= 34);
  for (const std::string_view host : strange_hosts) {
    CAPTURE(host);
    const std::string sent = at_port(host, port);
    const int status = http_request(server.port(), "/", sent).status;
    CHECK((status == 403 || status == 400));               // 400: not the field of any host
    const WebSocketClient client(server.port(), {}, sent); // without an origin, as programs come
    CHECK_FALSE(client.open());
  }
  CHECK(http_request(server.port(), "/", "localhost:" + port).status == 200);
  CHECK(http_request(server.port(), "/", "[::1]:" + port).status == 200);
  STATIC_REQUIRE(strange_origins.size() >= 21);
  for (const std::string_view strange : strange_origins) {
    const std::string origin = at_port(strange, port);
    CAPTURE(origin);
    const WebSocketClient client(server.port(), origin);
    CHECK_FALSE(client.open());
    CHECK(client.status() == 403);
  }
  // Two of either, one of them allowed: which one counts is not left to chance.
  CHECK(http_request(server.port(), "/", {}, "GET", "Host: evil.example\r\n").status == 400);
  CHECK(
      http_request(server.port(), "/", {}, "GET", "Origin: http://localhost:" + port + "\r\nOrigin: null\r\n").status ==
      400);
  const WebSocketClient rebound(server.port(), "http://evil.example:" + port, "evil.example:" + port);
  CHECK(rebound.status() == 403);
  CHECK(server.opened == 0);
  WebSocketClient same(server.port(), "http://127.0.0.1:" + port);
  CHECK(echoes(same));
  WebSocketClient local(server.port(), "http://localhost:" + port, "localhost:" + port);
  CHECK(echoes(local));
  WebSocketClient program(server.port());
  CHECK(echoes(program));
}

TEST_CASE("What hosts and origins are allowed follows from the address served") {
  CHECK(host_allowed("127.0.0.1:80", "127.0.0.1", 80));
  CHECK(host_allowed("localhost", "127.0.0.1", 80));
  CHECK_FALSE(host_allowed("localhost", "127.0.0.1", 8080));
  CHECK_FALSE(host_allowed("", "127.0.0.1", 80));
  CHECK_FALSE(host_allowed("10.0.0.7:8080", "127.0.0.1", 8080));
  CHECK(host_allowed("10.0.0.7:8080", "0.0.0.0", 8080));
  CHECK_FALSE(host_allowed("lab.example:8080", "0.0.0.0", 8080));
  CHECK(origin_allowed("http://10.0.0.7:8080", "10.0.0.7:8080", "0.0.0.0", 8080));
  CHECK_FALSE(origin_allowed("http://10.0.0.9:8080", "10.0.0.7:8080", "0.0.0.0", 8080));
  CHECK_FALSE(origin_allowed("http://10.0.0.7:8080@evil.example", "10.0.0.7:8080", "0.0.0.0", 8080));
  CHECK_FALSE(origin_allowed("http://localhost:99999", "localhost:8080", "127.0.0.1", 8080));
}

TEST_CASE("A malformed, binary, long or too frequent message ends that client and no other") {
  WebServerOptions options;
  options.messages_per_second = 50;
  const TestServer server(options);
  WebSocketClient good(server.port());
  REQUIRE(echoes(good));
  const auto code_after = [&](const auto& act) {
    WebSocketClient client(server.port());
    act(client);
    CHECK(client.wait_for_close());
    return client.close_code();
  };
  CHECK(code_after([](WebSocketClient& client) { client.send("bad"); }) == 1007);
  CHECK(code_after([](WebSocketClient& client) { client.send_binary("bytes"); }) == 1003);
  // The server stops reading in the middle: its close can be lost with what is left unread.
  const int too_long = code_after([](WebSocketClient& client) { client.send(std::string(70'000, 'a')); });
  CHECK((too_long == 1009 || too_long == 1006));
  CHECK(code_after([](WebSocketClient& client) { client.send("\xff\xfe"); }) == 1007);
  CHECK(code_after([](WebSocketClient& client) {
          for (int i = 0; i < 300; ++i)
            client.send("echo");
        }) == 1008);
  CHECK(code_after([](WebSocketClient& client) {
          for (int i = 0; i < 300; ++i)
            client.ping();
        }) == 1008);
  CHECK(echoes(good));
  CHECK(soon([&] { return server.closed == 6; }));
}

TEST_CASE("Frames without content, and messages without an end, cost what they weigh and end their client") {
  WebServerOptions options;
  options.bytes_per_second = 20'000;
  const TestServer server(options);
  WebSocketClient good(server.port());
  REQUIRE(echoes(good));
  const std::string mask(4, '\0');
  const auto ended_by = [&](const std::string& first, const std::string& again) {
    WebSocketClient client(server.port());
    REQUIRE(client.open());
    const int before = server.closed;
    std::string frames = first;
    while (frames.size() < 60'000)
      frames += again;
    client.send_raw(frames);
    return soon([&] { return server.closed > before; });
  };
  CHECK(ended_by(std::string("\x01\x80", 2) + mask, std::string("\x00\x80", 2) + mask)); // empty continuations
  CHECK(ended_by(std::string("\x01\x81", 2) + mask + "x", std::string("\x00\x81", 2) + mask + "x"));
  CHECK(echoes(good));
}

TEST_CASE("What a client sends within its messages is counted in bytes, and in what it costs") {
  WebServerOptions options;
  options.bytes_per_second = 12'000;
  TestServer server(options);
  WebSocketClient good(server.port());
  WebSocketClient heavy(server.port());
  const std::string nested(4000, '[');
  for (int i = 0; i < 300; ++i) // as many messages as are allowed at once, 1.2 MB
    heavy.send(nested);
  CHECK(heavy.wait_for_close());
  CHECK((heavy.close_code() == 1008 || heavy.close_code() == 1006));
  CHECK(server.refused < 40);
  CHECK(echoes(good));
  WebSocketClient costly(server.port());
  for (int i = 0; i < 10; ++i)
    costly.send("dear"); // costs 1000 messages each
  CHECK(costly.wait_for_close());
  CHECK(costly.close_code() == 1008);
  CHECK(server.dear <= 2);
}

TEST_CASE("A download goes on for as long as its client takes it, and one that takes nothing is ended") {
  WebServerOptions options;
  options.patience = std::chrono::milliseconds(400);
  const TestServer server(options);
  server.write("long.txt", std::string(24'000'000, 'l')); // more than the system keeps between the two
  std::size_t taken = 0;
  const bool whole = slow_download(server.port(), "/long.txt", [&](std::size_t bytes) {
    taken = bytes;
    std::this_thread::sleep_for(std::chrono::milliseconds(100)); // 24 of these: six times the patience
    return true;
  });
  CHECK(whole);
  CHECK(taken == 24'000'000);
  int rests = 0;
  CHECK_FALSE(slow_download(server.port(), "/long.txt", [&](std::size_t) {
    if (rests++ == 0)
      std::this_thread::sleep_for(std::chrono::seconds(3));
    return true;
  }));
}

TEST_CASE("A client that does not read costs one message, and too much text ends it") {
  const TestServer server;
  WebSocketClient reader(server.port());
  WebSocketClient silent(server.port());
  silent.send("flood");
  // The system's buffers between the two take some; then nothing more is made.
  int before = -1;
  CHECK(soon([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    return std::exchange(before, server.floods.load()) == server.floods;
  }));
  CHECK(server.floods < 200);
  CHECK(echoes(reader));
  WebSocketClient mute(server.port());
  mute.send("talk");
  CHECK(soon([&] { return server.closed >= 1; }));
  CHECK(echoes(reader));
}

TEST_CASE("A thousand reconnects and ten thousand messages of noise leave the server as it was") {
  WebServerOptions options;
  options.messages_per_second = 1e6;
  TestServer server(options);
  const auto files = [] {
    const std::filesystem::directory_iterator open("/proc/self/fd");
    return std::distance(begin(open), end(open));
  };
  const auto before = files();
  for (int i = 0; i < 1000; ++i) {
    WebSocketClient client(server.port());
    REQUIRE(client.open());
    if (i % 3 == 0)
      client.send("echo");
  }
  CHECK(soon([&] { return server.opened == 1000 && server.closed == 1000; }));
  CHECK(soon([&] { return files() == before; }));
  std::uint64_t random = 1;
  std::optional<WebSocketClient> client;
  for (int i = 0; i < 10'000; ++i) {
    if (!client || !client->open())
      client.emplace(server.port());
    std::string noise;
    for (std::uint64_t n = 0; n < 1 + random % 60; ++n) {
      random = random * 6364136223846793005U + 1442695040888963407U;
      noise += static_cast<char>(random >> 57U);
    }
    client->send(i % 500 == 499 ? "bad" : noise);
    while (client->receive(0)) {
    }
    if (i % 500 == 499)
      CHECK(client->wait_for_close());
  }
  CHECK(soon([&] { return server.refused >= 10'000; }));
  client.reset();
  CHECK(soon([&] { return files() == before; }));
  WebSocketClient last(server.port());
  CHECK(echoes(last));
}

TEST_CASE("A taken port, a bad address and a bad port are told") {
  const TestServer server;
  WebServerOptions options;
  options.port = server.port();
  CHECK_THROWS_WITH(WebServer(options, {}), Catch::Contains("--port") && Catch::Contains("in use"));
  options.port = 0;
  options.address = "nowhere";
  CHECK_THROWS_AS(WebServer(options, {}), InputError);
  options.address = "127.0.0.1";
  options.port = 70000;
  CHECK_THROWS_AS(WebServer(options, {}), InputError);
}

TEST_CASE("More clients than allowed are turned away until one goes") {
  WebServerOptions options;
  options.clients = 2;
  const TestServer server(options);
  auto first = std::make_unique<WebSocketClient>(server.port());
  const WebSocketClient second(server.port());
  CHECK(first->open());
  CHECK(second.open());
  CHECK(WebSocketClient(server.port()).status() == 503);
  first.reset();
  CHECK(soon([&] { return server.closed == 1; }));
  CHECK(WebSocketClient(server.port()).open());
}

TEST_CASE("A server that ends while clients come in leaves none of them hanging") {
  WebServerOptions options;
  options.tick = std::chrono::milliseconds(1);
  for (int round = 0; round < 40; ++round) {
    auto server = std::make_unique<TestServer>(options);
    const int port = server->port();
    std::atomic<bool> ended{false};
    std::vector<std::thread> visitors;
    for (int k = 0; k < 2; ++k)
      visitors.emplace_back([&] {
        while (!ended)
          try {
            const WebSocketClient client(port);
          } catch (const std::exception&) { // refused: the server is gone
            std::this_thread::yield();
          }
      });
    CHECK(soon([&] { return server->opened > round % 4; }));
    server.reset();
    ended = true;
    for (std::thread& visitor : visitors)
      visitor.join();
  }
}
