#include "tests/support/haply_service.hpp"

#include <algorithm>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <sys/socket.h>
#include <thread>

namespace spherecut::tests {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using nlohmann::json;

json vector_of(const HaplyService::Vector& v) {
  return {{"x", v[0]}, {"y", v[1]}, {"z", v[2]}};
}

} // namespace

std::string haply_inventory() {
  return R"({"session_id": 7, "inverse3": [{"device_id": "049D",
    "config": {"type": "inverse3", "port": "COM12",
      "device_info": {"major_version": 7, "minor_version": 4, "id": "049D", "device_type": 4, "uuid": "0"},
      "gravity_compensation": {"enabled": true, "scaling_factor": 1.0}, "handedness": "right", "streaming_mode": "USB",
      "torque_scaling": {"enabled": true}, "home_return": {"enabled": false}, "preset": "defaults",
      "basis": {"permutation": "XYZ"},
      "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}}},
    "state": {"cursor_position": {"x": 0.0, "y": -0.12, "z": 0.15}, "cursor_velocity": {"x": 0.0, "y": 0.0, "z": 0.0},
      "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0}, "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
      "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
      "current_cursor_force": {"x": 0.0, "y": 0.0, "z": 0.0}, "control_domain": "cartesian", "control_mode": "idle"}}]})";
}

struct HaplyService::Data {
  Data(int port, const Vector& place)
      : acceptor(context, {asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(port)}), cursor(place) {
    own = acceptor.local_endpoint().port();
  }

  /// What the service answers.
  std::string answer() {
    if (nonsense)
      return "{\"inverse3\": [{\"device_id\"";
    json state = {{"session_id", 7}, {"inverse3", json::array()}};
    if (plugged)
      state["inverse3"].push_back(
          {{"device_id", "049D"},
           {"state", {{"cursor_position", vector_of(cursor)}, {"current_cursor_force", vector_of(force)}}}});
    if (turn)
      state["wireless_verse_grip"] =
          json::array({{{"device_id", "61576"},
                        {"state",
                         {{"orientation", {{"w", (*turn)[0]}, {"x", (*turn)[1]}, {"y", (*turn)[2]}, {"z", (*turn)[3]}}},
                          {"buttons", {{"a", pressed}, {"b", false}, {"c", false}}}}}}});
    return state.dump();
  }

  /// Takes what a client says; whether it is answered.
  bool take(const std::string& text) {
    const std::lock_guard lock(guard);
    ++messages;
    const json message = json::parse(text, nullptr, false);
    try {
      const json& device = message.at("inverse3").at(0);
      const json& vector = device.at("commands").at("set_cursor_force").at("vector");
      if (device.at("device_id") != "049D")
        ++refused;
      force = {vector.at("x").get<double>(), vector.at("y").get<double>(), vector.at("z").get<double>()};
      peak = std::max(peak, force[2]);
      if (message.contains("session")) {
        ++named;
        refused += message.at("session").at("configure").at("profile").at("name").is_string() ? 0 : 1;
      }
    } catch (const json::exception&) {
      ++refused;
    }
    if (fallen < most_fall) {
      fallen += fall;
      cursor[2] -= fall;
    }
    return !silent;
  }

  /// One client at a time, each on this thread.
  void serve() {
    while (!stopping) {
      beast::error_code error;
      tcp::socket accepted(context);
      acceptor.accept(accepted, error);
      if (error || stopping)
        return;
      accepted.set_option(tcp::no_delay(true), error);
      serve(beast::websocket::stream<tcp::socket>(std::move(accepted)));
      if (last_message > 0 && messages >= last_message) {
        acceptor.close(error);
        return;
      }
    }
  }
  void serve(beast::websocket::stream<tcp::socket> client) {
    {
      const std::lock_guard lock(guard);
      descriptor = client.next_layer().native_handle();
      ++connections;
      closed_well = false;
    }
    beast::error_code error;
    client.accept(error);
    client.text(true);
    if (!error)
      client.write(asio::buffer(first()), error);
    for (beast::flat_buffer buffer; !error && !stopping; buffer.consume(buffer.size())) {
      client.read(buffer, error);
      if (!error && take(beast::buffers_to_string(buffer.data())) && !ends())
        client.write(asio::buffer(locked_answer()), error);
      if (ends())
        break;
    }
    const std::lock_guard lock(guard);
    closed_well = error == beast::websocket::error::closed;
    descriptor = -1;
  }
  std::string first() {
    const std::lock_guard lock(guard);
    if (!plugged || nonsense)
      return answer();
    json inventory = json::parse(haply_inventory());
    inventory["inverse3"][0]["state"]["cursor_position"] = vector_of(cursor);
    return inventory.dump();
  }
  std::string locked_answer() {
    std::this_thread::sleep_for(std::chrono::milliseconds(pause.load()));
    const std::lock_guard lock(guard);
    return answer();
  }
  bool ends() {
    const std::lock_guard lock(guard);
    return last_message > 0 && messages >= last_message;
  }
  /// Wakes the thread out of whatever it waits for.
  void stop() {
    stopping = true;
    const std::lock_guard lock(guard);
    if (descriptor >= 0)
      ::shutdown(descriptor, SHUT_RDWR);
    ::shutdown(acceptor.native_handle(), SHUT_RDWR);
  }

  asio::io_context context{1};
  tcp::acceptor acceptor;
  int own = 0;
  std::atomic<bool> stopping{false};
  std::atomic<int> pause{0}; // ms
  std::mutex guard;          // of all below
  int descriptor = -1;
  Vector cursor, force{};
  std::optional<std::array<double, 4>> turn;
  bool pressed = false, silent = false, plugged = true, nonsense = false, closed_well = false;
  double fall = 0, most_fall = 0, fallen = 0, peak = 0;
  int messages = 0, refused = 0, named = 0, connections = 0, last_message = 0;
  std::thread thread;
};

HaplyService::HaplyService(int port, const Vector& cursor) : data_(std::make_unique<Data>(port, cursor)) {
  data_->thread = std::thread([this] { data_->serve(); });
}

HaplyService::~HaplyService() {
  data_->stop();
  data_->thread.join();
}

int HaplyService::port() const {
  return data_->own;
}

std::string HaplyService::address() const {
  return "ws://127.0.0.1:" + std::to_string(port());
}

void HaplyService::set_cursor(const Vector& cursor) {
  const std::lock_guard lock(data_->guard);
  data_->cursor = cursor;
}

void HaplyService::set_fall(double step, double most) {
  const std::lock_guard lock(data_->guard);
  data_->fall = step;
  data_->most_fall = most;
}

void HaplyService::set_grip(const std::array<double, 4>& turn, bool pressed) {
  const std::lock_guard lock(data_->guard);
  data_->turn = turn;
  data_->pressed = pressed;
}

void HaplyService::set_silent(bool silent) {
  const std::lock_guard lock(data_->guard);
  data_->silent = silent;
}

void HaplyService::set_plugged(bool plugged) {
  const std::lock_guard lock(data_->guard);
  data_->plugged = plugged;
}

void HaplyService::set_pause(int milliseconds) {
  data_->pause = milliseconds;
}

void HaplyService::close_after(int messages) {
  const std::lock_guard lock(data_->guard);
  data_->last_message = messages;
}

void HaplyService::set_nonsense(bool nonsense) {
  const std::lock_guard lock(data_->guard);
  data_->nonsense = nonsense;
}

HaplyService::Vector HaplyService::force() const {
  const std::lock_guard lock(data_->guard);
  return data_->force;
}

double HaplyService::peak() const {
  const std::lock_guard lock(data_->guard);
  return data_->peak;
}

int HaplyService::messages() const {
  const std::lock_guard lock(data_->guard);
  return data_->messages;
}

int HaplyService::refused() const {
  const std::lock_guard lock(data_->guard);
  return data_->refused;
}

int HaplyService::named() const {
  const std::lock_guard lock(data_->guard);
  return data_->named;
}

int HaplyService::connections() const {
  const std::lock_guard lock(data_->guard);
  return data_->connections;
}

bool HaplyService::closed_well() const {
  const std::lock_guard lock(data_->guard);
  return data_->closed_well;
}

int free_port() {
  asio::io_context context;
  const tcp::acceptor acceptor(context, {asio::ip::address_v4::loopback(), 0});
  return acceptor.local_endpoint().port();
}

} // namespace spherecut::tests
