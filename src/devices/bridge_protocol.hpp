// Packets between a haptic bridge and its client, as bytes (docs/haptic_bridge.md): pose in, force out, from version 2
// on with its torque. No sockets here.
#pragma once

#include "topology/base/types.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace spherecut::app {

inline constexpr std::uint16_t bridge_version = 2;               // the newest; every one from 1 on is spoken
inline constexpr std::size_t bridge_head = 16, bridge_body = 88; // bytes: hello and goodbye; pose and force
inline constexpr std::size_t bridge_wrench = 112;                // bytes: force with its torque, from version 2 on
inline constexpr double bridge_farthest = 10;                    // m, of a coordinate of a pose
inline constexpr std::uint16_t bridge_last_mode = 3;             // HandMode::grasper

enum class BridgePacket : std::uint16_t { hello = 1, pose = 2, goodbye = 3, force = 4 };

/// What a client sends. Of hello and goodbye only kind and token count.
struct BridgeRequest {
  BridgePacket kind = BridgePacket::hello;
  std::uint64_t token = 0;            // of the session, from the bridge's force packets; of hello: any
  std::uint64_t sequence = 0;         // of the pose, rising
  Vector3 position = Vector3::Zero(); // m
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  std::uint16_t mode = 0, buttons = 0;
  std::uint16_t version = 1;
};

/// What the bridge sends to the client that holds the tool, once a tick.
struct BridgeReply {
  std::uint64_t token = 0;
  std::uint64_t tick = 0;
  std::uint64_t sequence = 0;         // of the pose that was newest
  Vector3 force = Vector3::Zero();    // N, on the hand
  Vector3 position = Vector3::Zero(); // m, where the loop has the tool: before the first pose, where it waits
  double timeout = 0;                 // s without a pose after which the tool is let go
  Vector3 torque = Vector3::Zero();   // N m, on the hand about the tool's reference point; from version 2 on
  std::uint16_t version = 1;
};

/// Reads a packet of a client. False: garbage (size, magic, version, kind, numbers that are not finite or out of range,
/// an orientation that is none), and `request` means nothing. The orientation is made unit.
bool read_packet(std::span<const std::byte> bytes, BridgeRequest& request) noexcept;
/// Reads a packet of a bridge, under the same conditions.
bool read_packet(std::span<const std::byte> bytes, BridgeReply& reply) noexcept;

/// Writes a packet and returns its size.
std::size_t write_packet(const BridgeRequest& request, std::span<std::byte, bridge_body> bytes) noexcept;
std::size_t write_packet(const BridgeReply& reply, std::span<std::byte, bridge_wrench> bytes) noexcept;

} // namespace spherecut::app
