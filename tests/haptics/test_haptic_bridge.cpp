// The bridge to real hardware: its packets, and a device that goes on whatever arrives. Under AddressSanitizer and
// ThreadSanitizer too: the sources it needs and no more are compiled into this binary.
#include "src/devices/bridge_device.hpp"
#include "src/haptics/tick.hpp"
#include "tests/support/allocation_counter.hpp"
#include "topology/base/errors.hpp"

#include <arpa/inet.h>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <limits>
#include <netinet/in.h>
#include <random>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <utility>

using namespace spherecut;
using namespace spherecut::app;

namespace {

using Bytes = std::array<std::byte, bridge_body>;

/// A client on a socket of its own.
class Client {
 public:
  explicit Client(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0);
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void send(std::span<const std::byte> bytes) const {
    static_cast<void>(::send(socket_, bytes.data(), bytes.size(), 0));
  }
  void send(const BridgeRequest& request) const {
    Bytes bytes{};
    const std::size_t size = write_packet(request, bytes);
    send(std::span<const std::byte>(bytes.data(), size));
  }
  void hello() const {
    BridgeRequest request;
    request.version = version;
    send(request);
  }
  void pose(std::uint64_t sequence, const Vector3& position) const {
    send({BridgePacket::pose, token, sequence, position, Eigen::Quaterniond::Identity(), 1, 2, version});
  }
  /// Takes all that has come; false: nothing.
  bool listen() {
    bool any = false;
    std::array<std::byte, 200> bytes{};
    for (ssize_t size = 0; (size = ::recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT)) >= 0; any = true)
      if (!read_packet(std::span<const std::byte>(bytes.data(), static_cast<std::size_t>(size)), reply))
        FAIL("not a packet");
      else
        bytes_of_last = static_cast<std::size_t>(size);
    token = reply.token;
    return any;
  }
  /// Packets that have come.
  int count() {
    int packets = 0;
    for (std::array<std::byte, 200> bytes{}; ::recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT) >= 0;)
      ++packets;
    return packets;
  }
  std::uint64_t token = 0;
  BridgeReply reply;
  std::uint16_t version = 1;
  std::size_t bytes_of_last = 0; // packet

 private:
  int socket_;
};

BridgeSettings any_port(double timeout = 0.02) {
  return {"127.0.0.1", 0, timeout};
}

const PathPose waiting{0, {0.01, 0.02, 0.03}, Eigen::Quaterniond::Identity()};

/// One tick of a loop that answers every device with the same force. Loopback delivers before send() returns.
DeviceState tick(BridgeDevice& device, std::uint64_t number, const Vector3& force = {0, 0, 1},
                 const Vector3& torque = {0.1, 0.2, 0.3}) {
  const DeviceState state = device.read(number);
  device.render(force, torque);
  return state;
}

} // namespace

TEST_CASE("Packets come back as they went, and nothing else is taken for one") {
  BridgeRequest out{BridgePacket::pose, 77, 5, {0.1, -0.2, 0.3}, Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), 3, 9};
  Bytes bytes{};
  REQUIRE(write_packet(out, bytes) == bridge_body);
  BridgeRequest in;
  REQUIRE(read_packet(bytes, in));
  CHECK(in.token == 77);
  CHECK(in.sequence == 5);
  CHECK(in.position == out.position);
  CHECK(in.orientation.coeffs() == out.orientation.coeffs());
  CHECK(in.mode == 3);
  CHECK(in.buttons == 9);
  CHECK(std::to_integer<int>(bytes[0]) == 'S'); // the page's layout: magic, version, kind, token, sequence
  CHECK(std::to_integer<int>(bytes[3]) == 'B');
  CHECK(std::to_integer<int>(bytes[4]) == 1);
  CHECK(std::to_integer<int>(bytes[6]) == 2);
  CHECK(std::to_integer<int>(bytes[8]) == 77);
  CHECK(std::to_integer<int>(bytes[16]) == 5);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    CHECK_FALSE(read_packet(std::span<const std::byte>(bytes.data(), size), in));
  for (std::size_t last = bridge_body - 4; last < bridge_body; ++last) { // zero, the page says
    Bytes other = bytes;
    other[last] = std::byte{1};
    CHECK_FALSE(read_packet(other, in));
  }
  const auto refused = [&](const Vector3& position, const Eigen::Quaterniond& orientation) {
    out.position = position;
    out.orientation = orientation;
    write_packet(out, bytes);
    return !read_packet(bytes, in);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Quaterniond upright = Eigen::Quaterniond::Identity();
  CHECK(refused({nan, 0, 0}, upright));
  CHECK(refused({0, 1e300, 0}, upright));
  CHECK(refused({0, 0, -std::numeric_limits<double>::infinity()}, upright));
  CHECK(refused({0, 0, 0}, Eigen::Quaterniond(0, 0, 0, 0)));
  CHECK(refused({0, 0, 0}, Eigen::Quaterniond(nan, 0, 0, 0)));
  CHECK(refused({0, 0, 0}, Eigen::Quaterniond(1e200, 0, 0, 0)));
  CHECK_FALSE(refused({0, 0, 0}, Eigen::Quaterniond(1.0005, 0, 0, 0)));
  CHECK(in.orientation.norm() == Approx(1).epsilon(1e-14));
}

TEST_CASE("No bytes do the parser harm, and what it takes is in range") {
  std::mt19937_64 random(11);
  BridgeRequest valid{BridgePacket::pose, 1, 2, {0.1, 0.2, 0.3}, Eigen::Quaterniond::Identity(), 0, 0};
  int taken = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::size_t size = i % 3 == 0 ? bridge_body : i % 3 == 1 ? bridge_head : random() % 200;
    std::vector<std::byte> bytes(size); // its own size, so that a read past its end is seen
    for (std::byte& b : bytes)
      b = static_cast<std::byte>(random());
    Bytes good{};
    write_packet(valid, good);
    if (i % 2 == 0 && size > 0) { // a good packet but for one byte
      std::memcpy(bytes.data(), good.data(), std::min(size, good.size()));
      bytes[random() % size] = static_cast<std::byte>(random());
    }
    BridgeRequest in;
    BridgeReply reply;
    static_cast<void>(read_packet(bytes, reply));
    if (!read_packet(bytes, in) || in.kind != BridgePacket::pose)
      continue;
    ++taken;
    CHECK(in.position.cwiseAbs().maxCoeff() <= bridge_farthest);
    CHECK(in.orientation.norm() == Approx(1));
  }
  CHECK(taken > 100);
}

TEST_CASE("The first client holds the tool until it falls silent or says goodbye") {
  BridgeDevice device(any_port(), waiting, 1000);
  Client first(device.port());
  Client second(device.port());
  DeviceState state = tick(device, 0);
  CHECK_FALSE(state.connected);
  CHECK(state.position == waiting.position);
  CHECK_FALSE(first.listen());
  first.hello();
  second.hello();
  state = tick(device, 1);
  CHECK_FALSE(state.connected); // it has sent no pose yet
  REQUIRE(first.listen());
  REQUIRE(second.listen()); // who comes first is told by the first pose
  CHECK(second.token != first.token);
  CHECK(first.reply.position == waiting.position);
  CHECK(first.reply.timeout == 0.02);
  CHECK(first.token != 0);
  first.pose(1, {0, 0, 0.04});
  const std::uint64_t own = std::exchange(second.token, first.token); // as if it had heard it
  second.pose(9, {1, 1, 1});
  second.token = own;
  second.pose(10, {1, 1, 1}); // somebody has been faster
  state = tick(device, 2, {0, 0, 2});
  CHECK(state.connected);
  CHECK(state.position == Vector3(0, 0, 0.04));
  CHECK(state.mode == 1);
  CHECK(state.buttons == 2);
  REQUIRE(first.listen());
  CHECK(first.reply.force == Vector3(0, 0, 2));
  CHECK(first.reply.sequence == 1);
  CHECK(first.reply.tick == 2);
  first.pose(3, {0, 0, 0.05});
  first.pose(2, {0, 0, 0.06}); // late
  CHECK(tick(device, 3).position.z() == 0.05);
  std::uint64_t t = 4;
  for (; t < 22; ++t)
    CHECK(tick(device, t).connected);
  for (; t < 25; ++t)
    state = tick(device, t);
  CHECK_FALSE(state.connected);
  CHECK(state.position.z() == 0.05); // where it was
  first.pose(4, {0, 0, 0.07});       // its token is worth nothing any more
  second.hello();
  tick(device, t++);
  REQUIRE(second.listen());
  CHECK(second.token != first.token);
  second.pose(1, {0, 0, 0.08});
  CHECK(tick(device, t++).connected);
  second.send({BridgePacket::goodbye, second.token});
  CHECK_FALSE(tick(device, t++).connected);
  const BridgeCounters& counters = device.counters();
  CHECK(counters.clients == 2);
  CHECK(counters.lost == 1);
  CHECK(counters.old == 1);
  CHECK(counters.others == 3);
  CHECK(counters.poses == 3);
  CHECK(counters.garbage == 0);
}

TEST_CASE("A client gets the version that it speaks: the first as it was, the second with the torque") {
  const BridgeReply reply{3, 5, 7, {1, 2, 3}, {4, 5, 6}, 0.5, {0.1, 0.2, 0.3}, 1};
  std::array<std::byte, bridge_wrench> old{}, now{};
  REQUIRE(write_packet(reply, old) == 88);
  BridgeReply second = reply;
  second.version = 2;
  REQUIRE(write_packet(second, now) == 112);
  CHECK(std::to_integer<int>(old[4]) == 1);
  CHECK(std::to_integer<int>(now[4]) == 2);
  now[4] = old[4];
  CHECK(std::equal(old.begin(), old.begin() + 88, now.begin())); // the rest as it was
  std::array<double, 3> torque{};
  std::memcpy(torque.data(), now.data() + 88, sizeof torque);
  CHECK(torque == std::array<double, 3>{0.1, 0.2, 0.3});
  BridgeReply in;
  now[4] = std::byte{2};
  REQUIRE(read_packet(now, in));
  CHECK(in.torque == reply.torque);
  CHECK_FALSE(read_packet(std::span<const std::byte>(now.data(), 88), in)); // of the other version's size
  now[4] = std::byte{1};
  CHECK_FALSE(read_packet(now, in));
  for (const int version : {0, 3})
    for (const std::size_t size : {bridge_head, bridge_body}) {
      Bytes request{};
      write_packet(BridgeRequest{size == bridge_head ? BridgePacket::hello : BridgePacket::pose}, request);
      request[4] = static_cast<std::byte>(version);
      BridgeRequest read;
      CHECK_FALSE(read_packet(std::span<const std::byte>(request.data(), size), read));
    }

  for (const std::uint16_t version : {std::uint16_t{1}, std::uint16_t{2}}) {
    BridgeDevice device(any_port(), waiting, 1000);
    Client client(device.port());
    client.version = version;
    client.hello();
    tick(device, 0);
    REQUIRE(client.listen());
    CHECK(client.bytes_of_last == (version == 1 ? 88 : 112));
    CHECK(client.reply.torque.isZero(0)); // nobody holds the tool
    client.pose(1, {0, 0, 0.04});
    tick(device, 1, {0, 0, 2}, {0, 0.25, 0});
    REQUIRE(client.listen());
    CHECK(client.reply.version == version);
    CHECK(client.reply.force == Vector3(0, 0, 2));
    CHECK(client.reply.torque == Vector3(0, version == 1 ? 0 : 0.25, 0));
    client.version = 3 - version; // of the session is the version of its first pose
    client.pose(2, {0, 0, 0.05});
    CHECK(tick(device, 2).position.z() == 0.04);
    CHECK(device.counters().garbage == 1);
  }
}

TEST_CASE("A hello is answered once, with one packet, until its token comes back from where it was sent") {
  BridgeDevice device(any_port(), waiting, 1000);
  Client victim(device.port()); // whose address a forger writes on its hellos
  Client client(device.port());
  std::uint64_t t = 0;
  for (int i = 0; i < 5; ++i)
    victim.hello();
  int answers = 0;
  for (; t < 300; ++t) {
    tick(device, t);
    answers += victim.count();
  }
  CHECK(answers == 5);
  CHECK(device.counters().clients == 0);
  for (int i = 0; i < 10; ++i) { // nor does it keep anyone else from the tool
    victim.hello();
    tick(device, t++);
  }
  client.hello();
  tick(device, t++);
  REQUIRE(client.listen());
  const std::uint64_t token = client.token;
  client.token = token + 1;
  client.pose(1, {0, 0, 0.01});
  CHECK_FALSE(tick(device, t++).connected);
  client.token = token;
  client.pose(1, {0, 0, 0.01});
  CHECK(tick(device, t++).connected);
  CHECK(device.counters().clients == 1);
}

TEST_CASE("A pose that is not finite is counted, and the poses after it are those that were sent") {
  BridgeDevice device(any_port(), waiting, 1000);
  Client client(device.port());
  client.hello();
  tick(device, 0);
  REQUIRE(client.listen());
  client.pose(1, {0, 0, 0.01});
  CHECK(tick(device, 1).position == Vector3(0, 0, 0.01));
  const double infinite = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  client.pose(2, {nan, 0, 0});
  client.pose(3, {0, infinite, 0});
  client.send({BridgePacket::pose, client.token, 4, Vector3::Zero(), Eigen::Quaterniond(nan, 0, 0, 0), 1, 2});
  const DeviceState held = tick(device, 2);
  CHECK(held.connected);
  CHECK(held.position == Vector3(0, 0, 0.01));
  CHECK(held.orientation.coeffs() == Eigen::Quaterniond::Identity().coeffs());
  CHECK(device.counters().garbage == 3);
  REQUIRE(client.listen());
  CHECK(client.reply.sequence == 1);
  client.pose(2, {0, 0, 0.02}); // its number was not used up
  CHECK(tick(device, 3).position == Vector3(0, 0, 0.02));
  CHECK(device.counters().poses == 2);
}

TEST_CASE("A flood of garbage costs a tick so many packets and no more, and the client is heard through it") {
  BridgeDevice device(any_port(0.05), waiting, 1000);
  Client client(device.port());
  Client flooder(device.port());
  client.hello();
  tick(device, 0);
  REQUIRE(client.listen());
  const std::vector<std::byte> junk(1400, std::byte{7});
  const std::size_t allocations = tests::allocations();
  std::uint64_t before = 0;
  std::uint64_t heard = 0;
  for (std::uint64_t t = 1; t <= 200; ++t) {
    client.pose(t, {0, 0, 1e-5 * static_cast<double>(t)});
    for (int i = 0; i < 3; ++i)
      flooder.send(junk);
    heard += tick(device, t).connected ? 1 : 0;
    const BridgeCounters& counters = device.counters();
    const std::uint64_t now = counters.garbage + counters.poses + counters.old + counters.others;
    CHECK(now - before <= BridgeDevice::most_packets + BridgeDevice::most_others);
    before = now;
    client.listen();
  }
  CHECK(tests::allocations() == allocations);
  CHECK(heard == 200);
  CHECK(device.counters().garbage == 600);
  CHECK(client.reply.sequence == 200);
  for (int i = 0; i < 2000; ++i) // the queue for everyone is full of it, the client's is not
    flooder.send(junk);
  DeviceState state;
  for (std::uint64_t t = 201; t <= 300; ++t) {
    for (int i = 0; i < 40; ++i)
      flooder.send(junk);
    client.pose(t, {0, 0, 1e-4 * static_cast<double>(t)});
    state = tick(device, t, Vector3(0, 0, 0.5));
    CHECK(state.connected);
    CHECK(state.position.z() == 1e-4 * static_cast<double>(t));
    REQUIRE(client.listen());
    CHECK(client.reply.sequence == t);
    CHECK(client.reply.force.z() == 0.5);
  }
  CHECK(tests::allocations() == allocations);
  CHECK(device.counters().lost == 0);
  CHECK(device.counters().garbage <= 600 + 100 * BridgeDevice::most_others);
  for (std::uint64_t t = 301; t <= 600; ++t) // the client is silent, the flood is over
    state = tick(device, t);
  CHECK_FALSE(state.connected); // and once it is over, the next hello is heard
  client.hello();
  tick(device, 601);
  REQUIRE(client.listen());
  client.pose(1, {0, 0, 0.02});
  CHECK(tick(device, 602).connected);
}

TEST_CASE("When the client vanishes, the force goes to zero at the slew limit and stays there") {
  const topology::ToolShape tool = topology::SphereTip{0.004};
  HapticSettings settings;
  settings.model = ForceModelKind::hold;
  settings.limits.slew = 50; // N/s: 0.05 N a tick
  BridgeDevice device(any_port(), waiting, 1000);
  HapticTick core(settings, tool, nullptr);
  ContactSnapshot snapshot;
  snapshot.sequence = 1;
  snapshot.mode = 1; // as the client says
  snapshot.force = {0, 0, 1};
  core.arrive(snapshot);
  Client client(device.port());
  client.hello();
  Vector3 last = Vector3::Zero();
  double largest_step = 0;
  bool rose = false;
  std::uint64_t zero_from = 0;
  for (std::uint64_t t = 0; t < 300; ++t) {
    if (t > 0 && t < 100 && client.listen())
      client.pose(t, waiting.position);
    const DeviceState state = device.read(t);
    if (t == 0)
      core.start(state);
    const Vector3 force = core.tick(state).force;
    device.apply(force);
    largest_step = std::max(largest_step, (force - last).norm());
    rose = rose || force.norm() > 0.99;
    zero_from = force.norm() > 0 ? t + 1 : zero_from;
    last = force;
  }
  CHECK(rose);
  CHECK(largest_step <= 0.05 + 1e-12);
  CHECK(zero_from > 119);
  CHECK(zero_from < 145); // 20 ticks of silence, 20 ticks of slew
}

TEST_CASE("A bridge says why it cannot be made") {
  CHECK_THROWS_WITH(BridgeDevice({"nowhere", 0, 0.1}, waiting, 1000), Catch::Contains("nowhere"));
  CHECK_THROWS_AS(BridgeDevice({"203.0.113.9", 0, 0.1}, waiting, 1000), InputError); // not of this machine
  const BridgeDevice one(any_port(), waiting, 1000);
  CHECK_THROWS_WITH(BridgeDevice({"127.0.0.1", one.port(), 0.1}, waiting, 1000), Catch::Contains("in use"));
}

TEST_CASE("The example client feels a spring, and clients on threads of their own do not stop the loop") {
  BridgeDevice device(any_port(60), waiting, 1000); // nobody is taken for gone because a machine is slow
  std::atomic<bool> done{false}, held{false};
  int status = -1;
  std::thread example([&] {
    const std::string command =
        std::string(SPHERECUT_BRIDGE_CLIENT) + " " + std::to_string(device.port()) + " 2 >/dev/null";
    status = std::system(command.c_str());
    done.store(true);
  });
  std::thread noise([&] {
    const Client other(device.port());
    const std::array<std::byte, 16> junk{};
    while (!held.load() && !done.load()) // whoever says hello first has the tool: the example does
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    for (std::uint64_t i = 0; !done.load(); ++i) {
      other.hello();
      other.pose(i, {0, 0, 0});
      other.send(junk);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  double deepest = 0;
  std::uint64_t ticks = 0;
  auto due = std::chrono::steady_clock::now();
  for (; !done.load() && ticks < 60000; ++ticks) {
    const DeviceState state = device.read(ticks);
    if (state.connected)
      held.store(true);
    const double depth = waiting.position.z() - state.position.z();
    deepest = std::max(deepest, depth);
    device.apply({0, 0, 100 * std::max(0.0, depth)});
    std::this_thread::sleep_until(due += std::chrono::milliseconds(1));
  }
  example.join();
  noise.join();
  CHECK(status == 0);
  CHECK(deepest > 0.001);
  CHECK(deepest < 0.0021);
  CHECK(device.counters().poses > 100);
  CHECK(device.counters().others > 10);
}
