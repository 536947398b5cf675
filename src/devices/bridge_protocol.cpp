#include "src/devices/bridge_protocol.hpp"

#include <bit>
#include <cmath>
#include <cstring>

namespace spherecut::app {
namespace {

static_assert(std::endian::native == std::endian::little, "packets are written as they lie in memory");

constexpr std::uint32_t magic = 0x42485053; // "SPHB"

/// Goes through a packet whose size has been checked.
class Cursor {
 public:
  explicit Cursor(const std::byte* at) : at_(at) {}
  template <typename T>
  T get() noexcept {
    std::array<std::byte, sizeof(T)> raw{};
    std::memcpy(raw.data(), at_, sizeof(T));
    at_ += sizeof(T);
    return std::bit_cast<T>(raw);
  }
  Vector3 vector() noexcept {
    Vector3 v;
    for (int axis = 0; axis < 3; ++axis)
      v[axis] = get<double>();
    return v;
  }

 private:
  const std::byte* at_;
};

class Pen {
 public:
  explicit Pen(std::byte* at) : at_(at) {}
  template <typename T>
  void put(T value) noexcept {
    std::memcpy(at_, &value, sizeof value);
    at_ += sizeof value;
  }
  void put_vector(const Vector3& v) noexcept {
    for (int axis = 0; axis < 3; ++axis)
      put(v[axis]);
  }
  void head(BridgePacket kind, std::uint64_t token, std::uint16_t version) noexcept {
    put(magic);
    put(version);
    put(static_cast<std::uint16_t>(kind));
    put(token);
  }

 private:
  std::byte* at_;
};

bool read_head(Cursor& in, std::uint16_t& kind, std::uint64_t& token, std::uint16_t& version) noexcept {
  if (in.get<std::uint32_t>() != magic)
    return false;
  version = in.get<std::uint16_t>();
  if (version < 1 || version > bridge_version)
    return false;
  kind = in.get<std::uint16_t>();
  token = in.get<std::uint64_t>();
  return true;
}

} // namespace

bool read_packet(std::span<const std::byte> bytes, BridgeRequest& request) noexcept {
  if (bytes.size() != bridge_head && bytes.size() != bridge_body)
    return false;
  Cursor in(bytes.data());
  std::uint16_t kind = 0;
  if (!read_head(in, kind, request.token, request.version))
    return false;
  request.kind = static_cast<BridgePacket>(kind);
  const bool short_one = request.kind == BridgePacket::hello || request.kind == BridgePacket::goodbye;
  if (bytes.size() == bridge_head)
    return short_one;
  if (request.kind != BridgePacket::pose)
    return false;
  request.sequence = in.get<std::uint64_t>();
  request.position = in.vector();
  for (int i = 0; i < 4; ++i)
    request.orientation.coeffs()[i] = in.get<double>();
  request.mode = in.get<std::uint16_t>();
  request.buttons = in.get<std::uint16_t>();
  const bool ends = in.get<std::uint32_t>() == 0;
  const double length = request.orientation.norm();
  if (!(request.position.cwiseAbs().maxCoeff() <= bridge_farthest) || !request.position.allFinite() ||
      !(std::abs(length - 1) < 1e-3) || request.mode > bridge_last_mode || !ends)
    return false;
  request.orientation.coeffs() /= length;
  return true;
}

bool read_packet(std::span<const std::byte> bytes, BridgeReply& reply) noexcept {
  if (bytes.size() != bridge_body && bytes.size() != bridge_wrench)
    return false;
  Cursor in(bytes.data());
  std::uint16_t kind = 0;
  if (!read_head(in, kind, reply.token, reply.version) || static_cast<BridgePacket>(kind) != BridgePacket::force ||
      bytes.size() != (reply.version > 1 ? bridge_wrench : bridge_body))
    return false;
  reply.tick = in.get<std::uint64_t>();
  reply.sequence = in.get<std::uint64_t>();
  reply.force = in.vector();
  reply.position = in.vector();
  reply.timeout = in.get<double>();
  reply.torque = reply.version > 1 ? in.vector() : Vector3::Zero();
  return reply.force.allFinite() && reply.position.allFinite() && std::isfinite(reply.timeout) &&
         reply.torque.allFinite();
}

std::size_t write_packet(const BridgeRequest& request, std::span<std::byte, bridge_body> bytes) noexcept {
  Pen out(bytes.data());
  out.head(request.kind, request.token, request.version);
  if (request.kind != BridgePacket::pose)
    return bridge_head;
  out.put(request.sequence);
  out.put_vector(request.position);
  for (int i = 0; i < 4; ++i)
    out.put(request.orientation.coeffs()[i]);
  out.put(request.mode);
  out.put(request.buttons);
  out.put(std::uint32_t{0});
  return bridge_body;
}

std::size_t write_packet(const BridgeReply& reply, std::span<std::byte, bridge_wrench> bytes) noexcept {
  Pen out(bytes.data());
  out.head(BridgePacket::force, reply.token, reply.version);
  out.put(reply.tick);
  out.put(reply.sequence);
  out.put_vector(reply.force);
  out.put_vector(reply.position);
  out.put(reply.timeout);
  if (reply.version < 2)
    return bridge_body;
  out.put_vector(reply.torque);
  return bridge_wrench;
}

} // namespace spherecut::app
