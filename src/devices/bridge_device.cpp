#include "src/devices/bridge_device.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <netinet/in.h>
#include <random>
#include <sys/socket.h>
#include <unistd.h>

namespace spherecut::app {
namespace {

constexpr int queue_bytes = 64 * 1024;      // of the system's queue: old poses are worth nothing
constexpr std::size_t largest_packet = 128; // longer ones are cut off there, and garbage

/// SipHash-2-4 of two words [Aumasson and Bernstein 2012]: without the key nobody can tell what it gives.
std::uint64_t keyed_hash(const std::array<std::uint64_t, 2>& key, std::uint64_t first, std::uint64_t second) noexcept {
  std::uint64_t a = key[0] ^ 0x736f6d6570736575U, b = key[1] ^ 0x646f72616e646f6dU, c = key[0] ^ 0x6c7967656e657261U,
                d = key[1] ^ 0x7465646279746573U;
  const auto rounds = [&](int count) {
    for (int i = 0; i < count; ++i) {
      a += b;
      c += d;
      b = std::rotl(b, 13) ^ a;
      d = std::rotl(d, 16) ^ c;
      a = std::rotl(a, 32);
      c += b;
      a += d;
      b = std::rotl(b, 17) ^ c;
      d = std::rotl(d, 21) ^ a;
      c = std::rotl(c, 32);
    }
  };
  for (const std::uint64_t word : {first, second, std::uint64_t{16} << 56U}) {
    d ^= word;
    rounds(2);
    a ^= word;
  }
  c ^= 0xff;
  rounds(4);
  return a ^ b ^ c ^ d;
}

} // namespace

struct BridgeDevice::Socket {
  int open = -1;        // for everyone
  int held = -1;        // connected to the client; to the port itself while there is none: nobody sends from there
  sockaddr_in own{};    // address and port
  sockaddr_in client{}; // that holds the tool
  std::array<std::array<std::byte, largest_packet>, most_packets> bytes{};
  std::array<sockaddr_in, most_packets> from{};
  std::array<iovec, most_packets> parts{};
  std::array<mmsghdr, most_packets> messages{};

  /// Whether the two may have one port, and with that anyone else who asks for it so.
  void share_port(bool shared) const {
    const int value = shared ? 1 : 0;
    for (const int descriptor : {open, held})
      ::setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &value, sizeof value);
  }
  /// From now on `held` takes what comes from there alone.
  void connect_to(const sockaddr_in& peer) const noexcept {
    const sockaddr_in nobody{.sin_family = AF_UNSPEC, .sin_port = 0, .sin_addr = {}, .sin_zero = {}};
    // A bound datagram socket only keeps the address. The first call forgets that of the last client.
    static_cast<void>(::connect(held, reinterpret_cast<const sockaddr*>(&nobody), sizeof nobody));
    static_cast<void>(::connect(held, reinterpret_cast<const sockaddr*>(&peer), sizeof peer));
  }
  void close() const noexcept {
    for (const int descriptor : {open, held})
      if (descriptor >= 0)
        ::close(descriptor);
  }
};

BridgeDevice::BridgeDevice(const BridgeSettings& settings, const PathPose& waiting, double rate)
    : socket_(std::make_unique<Socket>()), rate_(rate), timeout_(settings.timeout),
      silence_(static_cast<std::uint64_t>(std::max(1.0, std::ceil(settings.timeout * rate)))), pace_(rate) {
  const auto fail = [&](const std::string& what) {
    socket_->close();
    throw InputError(fmt::format("haptic bridge at {} port {}: {}", settings.address, settings.port, what));
  };
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(settings.port));
  if (inet_pton(AF_INET, settings.address.c_str(), &address.sin_addr) != 1)
    fail("not an address; allowed: four numbers as in 127.0.0.1");
  const auto bound = [&] {
    const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (descriptor < 0)
      fail(std::strerror(errno));
    (socket_->open < 0 ? socket_->open : socket_->held) = descriptor;
    ::setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &queue_bytes, sizeof queue_bytes);
    if (descriptor == socket_->held)
      socket_->share_port(true);
    // The socket calls take any address as a sockaddr.
    if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      fail(std::strerror(errno));
    socklen_t size = sizeof address;
    if (::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      fail(std::strerror(errno));
  };
  bound();
  bound(); // at the port that the first has got
  socket_->share_port(false);
  socket_->own = address;
  socket_->connect_to(address);
  port_ = ntohs(address.sin_port);
  for (std::size_t i = 0; i < most_packets; ++i) {
    socket_->parts[i] = {socket_->bytes[i].data(), largest_packet};
    socket_->messages[i].msg_hdr.msg_name = &socket_->from[i];
    socket_->messages[i].msg_hdr.msg_iov = &socket_->parts[i];
    socket_->messages[i].msg_hdr.msg_iovlen = 1;
  }
  std::random_device noise;
  for (std::uint64_t& word : key_)
    word = (static_cast<std::uint64_t>(noise()) << 32U) ^ noise();
  state_.position = waiting.position;
  state_.orientation = waiting.orientation;
  state_.connected = false;
}

BridgeDevice::~BridgeDevice() {
  socket_->close();
}

void BridgeDevice::release() noexcept {
  held_ = false;
  state_.connected = false;
  state_.buttons = 0;
  state_.client = {}; // the tool stays where the loop has it
  pace_watch_.forget();
  socket_->connect_to(socket_->own);
}

void BridgeDevice::take(std::size_t packet) noexcept {
  const mmsghdr& message = socket_->messages[packet];
  const sockaddr_in& from = socket_->from[packet];
  BridgeRequest request;
  const std::size_t size = (message.msg_hdr.msg_flags & MSG_TRUNC) != 0 ? largest_packet : message.msg_len;
  if (!read_packet(std::span<const std::byte>(socket_->bytes[packet].data(), size), request)) {
    ++counters_.garbage;
    return;
  }
  const bool holder =
      held_ && from.sin_addr.s_addr == socket_->client.sin_addr.s_addr && from.sin_port == socket_->client.sin_port;
  if (request.kind == BridgePacket::hello) {
    if (held_)
      counters_.others += holder ? 0 : 1;
    else
      reply(from, token_for(from), request.version, Vector3::Zero(), Vector3::Zero());
    return;
  }
  if (!held_ && request.kind == BridgePacket::pose && request.token == token_for(from)) {
    ++counters_.clients;
    held_ = true;
    posed_ = false;
    token_ = request.token;
    version_ = request.version;
    ++sessions_;
    pace_.begin();
    socket_->client = from;
    socket_->connect_to(from);
  } else if (!holder || request.token != token_) {
    ++counters_.others;
    return;
  }
  if (request.version != version_) {
    ++counters_.garbage;
    return;
  }
  if (request.kind == BridgePacket::goodbye) {
    release();
    return;
  }
  if (posed_ && request.sequence <= sequence_) {
    ++counters_.old;
    return;
  }
  ++counters_.poses;
  posed_ = true;
  sequence_ = request.sequence;
  heard_ = state_.tick;
  pace_.take(request.position, request.orientation, state_.tick);
  state_.mode = request.mode;
  state_.buttons = request.buttons;
  state_.connected = true;
}

void BridgeDevice::take_from(int descriptor, int most) noexcept {
  for (mmsghdr& message : socket_->messages)
    message.msg_hdr.msg_namelen = sizeof(sockaddr_in);
  const auto receive = [&] {
    return ::recvmmsg(descriptor, socket_->messages.data(), static_cast<unsigned>(most), MSG_DONTWAIT, nullptr);
  };
  int count = receive();
  if (count < 0 && errno == ECONNREFUSED) // an earlier force found nobody there; packets wait behind that news
    count = receive();
  for (int i = 0; i < count; ++i)
    take(static_cast<std::size_t>(i));
}

DeviceState BridgeDevice::read(std::uint64_t tick) noexcept {
  state_.tick = tick;
  state_.time = static_cast<double>(tick) / rate_;
  if (held_)
    take_from(socket_->held, most_packets);
  take_from(socket_->open, held_ ? most_others : most_packets);
  if (held_ && tick - heard_ >= silence_) {
    ++counters_.lost;
    release();
  }
  if (held_) {
    pace_.lead(state_);
    pace_watch_.count(pace_, state_, counters_);
  }
  return state_;
}

// What has to come back before anybody gets more than one packet for one of his own. It is made from the address that a
// hello says it comes from, and not kept: whoever forges that address does not learn it, and takes nobody's place.
std::uint64_t BridgeDevice::token_for(const sockaddr_in& from) const noexcept {
  const std::uint64_t place = static_cast<std::uint64_t>(from.sin_addr.s_addr) << 16U | from.sin_port;
  return std::max<std::uint64_t>(keyed_hash(key_, sessions_, place), 1);
}

void BridgeDevice::reply(const sockaddr_in& to, std::uint64_t token, std::uint16_t version, const Vector3& force,
                         const Vector3& torque) noexcept {
  std::array<std::byte, bridge_wrench> bytes{};
  const std::size_t size = write_packet(
      BridgeReply{token, state_.tick, posed_ ? sequence_ : 0, force, state_.position, timeout_, torque, version},
      bytes);
  if (::sendto(socket_->open, bytes.data(), size, MSG_DONTWAIT | MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to),
               sizeof to) < 0)
    ++counters_.unsent;
}

void BridgeDevice::render(const Vector3& force, const Vector3& torque) noexcept {
  if (held_)
    reply(socket_->client, token_, version_, force, torque);
}

} // namespace spherecut::app
