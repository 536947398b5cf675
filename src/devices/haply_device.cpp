#include "src/devices/haply_device.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <optional>

namespace spherecut::app {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using Clock = std::chrono::steady_clock;

constexpr auto first_patience = std::chrono::seconds(5);       // for a connection, and for the first state
constexpr auto patience = std::chrono::seconds(2);             // for an answer
constexpr auto retry = std::chrono::milliseconds(500);         // between two attempts to connect again
constexpr auto last_patience = std::chrono::milliseconds(200); // for what is under way at the end
constexpr auto least_exchange =
    std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / HaplyDevice::most_exchanges));
constexpr std::size_t longest_message = std::size_t{1} << 20U;

} // namespace

struct HaplyDevice::Service {
  asio::io_context context{1};
  tcp::resolver::results_type places;
  WebSocketAddress address;
  std::optional<websocket::stream<tcp::socket>> socket; // none: there is no connection
  beast::flat_buffer buffer;
  std::string sent;
  Clock::duration timeout{};
  bool first = true; // message of the connection
  Vector3 force = Vector3::Zero();
  Clock::time_point force_came;
  std::atomic<bool> stopping{false};

  /// Begins an operation on the socket and waits for its end; one that takes too long is ended with the socket.
  template <typename Begin>
  beast::error_code within(Clock::duration longest, Begin begin) {
    std::optional<beast::error_code> result;
    begin([&result](beast::error_code error, auto&&... /*rest*/) { result = error; });
    context.restart();
    auto until = Clock::now() + longest;
    for (bool told = false; !result && Clock::now() < until; context.run_one_until(until))
      if (!told && stopping) {
        told = true;
        until = std::min(until, Clock::now() + last_patience);
      }
    if (result)
      return *result;
    beast::error_code ignored;
    socket->next_layer().close(ignored);
    while (!result && context.run_one() > 0) {
    }
    return asio::error::timed_out;
  }

  beast::error_code write(std::string text) {
    sent = std::move(text);
    return within(patience, [this](auto done) { socket->async_write(asio::buffer(sent), done); });
  }
  beast::error_code read(Clock::duration longest) {
    buffer.consume(buffer.size());
    return within(longest, [this](auto done) { socket->async_read(buffer, done); });
  }
  [[nodiscard]] std::string_view text() const {
    const auto bytes = buffer.cdata();
    return {static_cast<const char*>(bytes.data()), bytes.size()};
  }

  /// Connects and reads the state that the service begins with. What went wrong, or empty.
  std::string connect() {
    socket.emplace(context);
    first = true;
    const auto failed = [this](const char* what, const beast::error_code& error) {
      socket.reset();
      return fmt::format("{}: {}", what, error.message());
    };
    if (const auto error =
            within(first_patience, [this](auto done) { asio::async_connect(socket->next_layer(), places, done); }))
      return failed("no Inverse service answers there", error);
    beast::error_code ignored;
    socket->next_layer().set_option(tcp::no_delay(true), ignored);
    socket->read_message_max(longest_message);
    const bool six = address.host.find(':') != std::string::npos;
    const std::string host =
        six ? fmt::format("[{}]:{}", address.host, address.port) : fmt::format("{}:{}", address.host, address.port);
    if (const auto error =
            within(first_patience, [&](auto done) { socket->async_handshake(host, address.path, done); }))
      return failed("what answers there is no WebSocket", error);
    socket->text(true);
    if (const auto error = read(first_patience))
      return failed("the service says nothing of its devices", error);
    return {};
  }

  /// The newest force; none of a loop that stands still.
  Vector3 take_force(TripleBuffer<Vector3>& forces) {
    const auto now = Clock::now();
    if (forces.fetch()) {
      force = forces.front();
      force_came = now;
    }
    if (now - force_came > timeout || !force.allFinite())
      force.setZero();
    return force;
  }
};

HaplyDevice::HaplyDevice(const HaplySettings& settings, const PathPose& waiting, double rate)
    : device_id_(settings.device_id), rate_(rate), timeout_(settings.timeout),
      silence_(static_cast<std::uint64_t>(std::max(1.0, std::ceil(settings.timeout * rate)))), pace_(rate),
      service_(std::make_unique<Service>()) {
  const auto fail = [&](const std::string& what) {
    throw InputError(fmt::format("haptics.haply.address = \"{}\": {}", settings.address, what));
  };
  const std::optional<WebSocketAddress> address = websocket_address(settings.address);
  if (!address)
    fail("not an address; allowed: ws://HOST:PORT, as in ws://localhost:10001");
  service_->address = *address;
  service_->timeout = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_));
  tcp::resolver resolver(service_->context);
  beast::error_code error;
  service_->places = resolver.resolve(address->host, std::to_string(address->port), error);
  if (error)
    fail(fmt::format("there is no such host: {}", error.message()));
  if (const std::string what = service_->connect(); !what.empty())
    fail(what);
  const std::string_view inventory = service_->text();
  const std::vector<std::string> devices = haply_devices(inventory);
  std::string listed;
  for (const std::string& device : devices)
    listed += (listed.empty() ? "" : ", ") + device;
  HaplyPose pose;
  switch (read_haply_message(inventory, device_id_, pose)) {
  case HaplyMessage::garbage:
    fail("what answers there is no Inverse service: its first message is not what is documented");
    break;
  case HaplyMessage::no_device:
    fail(devices.empty() ? "the service has no Inverse3; allowed: one that is plugged in"
                         : fmt::format("the service has no Inverse3 \"{}\"; allowed as haptics.haply.device_id: {}",
                                       device_id_, listed));
    break;
  case HaplyMessage::pose:
    break;
  }
  if (device_id_.empty())
    device_id_ = devices.front();
  state_.position = waiting.position;
  state_.orientation = waiting.orientation;
  state_.connected = false;
  thread_ = std::thread([this] { speak(); });
}

HaplyDevice::~HaplyDevice() {
  service_->stopping = true;
  asio::post(service_->context, [] {});
  thread_.join();
}

// The network thread.
void HaplyDevice::speak() {
  Service& service = *service_;
  const auto lose = [&] {
    service.socket.reset();
    link_.store(HaplyLink::gone, std::memory_order_relaxed);
  };
  auto next_attempt = Clock::now();
  while (!service.stopping) {
    const auto began = Clock::now();
    if (!service.socket) {
      if (began < next_attempt) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        continue;
      }
      next_attempt = began + retry;
      if (!service.connect().empty())
        continue;
      renewed_.fetch_add(1, std::memory_order_relaxed);
      hear(service.text());
    }
    const Vector3 force = service.take_force(forces_);
    if (service.write(haply_force_message(device_id_, force, std::exchange(service.first, false))) ||
        service.read(patience)) {
      lose();
      continue;
    }
    hear(service.text());
    std::this_thread::sleep_until(began + least_exchange);
  }
  if (!service.socket || service.write(haply_force_message(device_id_, Vector3::Zero(), service.first)))
    return;
  service.within(last_patience,
                 [&](auto done) { service.socket->async_close(websocket::close_code::going_away, done); });
}

void HaplyDevice::hear(std::string_view text) {
  messages_.fetch_add(1, std::memory_order_relaxed);
  switch (read_haply_message(text, device_id_, poses_.back())) {
  case HaplyMessage::garbage:
    garbage_.fetch_add(1, std::memory_order_relaxed);
    break;
  case HaplyMessage::no_device:
    link_.store(HaplyLink::no_device, std::memory_order_relaxed);
    break;
  case HaplyMessage::pose:
    poses_.publish();
    link_.store(HaplyLink::streams, std::memory_order_relaxed);
    break;
  }
}

HaplyLink HaplyDevice::link() const noexcept {
  const HaplyLink link = link_.load(std::memory_order_relaxed);
  return link == HaplyLink::streams && silent_.load(std::memory_order_relaxed) ? HaplyLink::silent : link;
}

HaplyCounters HaplyDevice::counters() const noexcept {
  HaplyCounters counters = counters_;
  counters.messages = messages_.load(std::memory_order_relaxed);
  counters.garbage = garbage_.load(std::memory_order_relaxed);
  counters.renewed = renewed_.load(std::memory_order_relaxed);
  return counters;
}

void HaplyDevice::release() noexcept {
  ++counters_.lost;
  held_ = false;
  state_.connected = false;
  state_.buttons = 0;
  state_.client = {};
  pace_watch_.forget();
}

void HaplyDevice::take(const HaplyPose& pose, std::uint64_t tick) noexcept {
  if (!held_) {
    held_ = true;
    grips_ = false;
    origin_ = pose.cursor;
    start_ = state_.position;
    pace_.begin();
    silent_.store(false, std::memory_order_relaxed);
  }
  if (pose.has_grip && !grips_) {
    grips_ = true;
    grip_ = pose.grip;
    turn_ = state_.orientation;
  }
  ++counters_.poses;
  heard_ = tick;
  const Eigen::Quaterniond turned = (pose.grip * grip_.conjugate() * turn_).normalized();
  pace_.take(start_ + pose.cursor - origin_, pose.has_grip ? turned : state_.orientation, tick);
  state_.buttons = pose.buttons;
  state_.connected = true;
}

DeviceState HaplyDevice::read(std::uint64_t tick) noexcept {
  state_.tick = tick;
  state_.time = static_cast<double>(tick) / rate_;
  if (poses_.fetch())
    take(poses_.front(), tick);
  else if (tick - heard_ >= silence_) {
    silent_.store(true, std::memory_order_relaxed);
    if (held_)
      release();
  }
  if (held_) {
    pace_.lead(state_);
    pace_watch_.count(pace_, state_, counters_);
  }
  return state_;
}

void HaplyDevice::apply(const Vector3& force) noexcept {
  forces_.back() = force;
  forces_.publish();
}

} // namespace spherecut::app
