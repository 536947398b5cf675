// A device behind a UDP socket: whoever owns the hardware runs a small client that sends its pose and gets the force
// (docs/haptic_bridge.md).
//
// Chosen here: the haptic thread itself asks the sockets, which never wait. Two of them have the port: one is connected
// to the client that holds the tool, so that the system puts that client's packets, and no others, into its queue; the
// other gets the rest, of which most_others a tick are looked at. So a flood from elsewhere costs those and no more,
// and does not crowd out the client. A thread of its own for the socket would add its wake-up to every force.
#pragma once

#include "src/devices/bridge_protocol.hpp"
#include "src/devices/client_pace.hpp"
#include "src/haptics/device.hpp"

#include <array>
#include <memory>

struct sockaddr_in;

namespace spherecut::app {

/// What has come in.
struct BridgeCounters : PaceCounters {
  std::uint64_t poses = 0;   // of the client that held the tool, taken
  std::uint64_t old = 0;     // of that client, with a sequence that was not newer
  std::uint64_t garbage = 0; // not a packet
  std::uint64_t others = 0;  // of someone who did not hold the tool, or with a wrong token
  std::uint64_t clients = 0; // that have held the tool: sent a pose with the token that answered their hello
  std::uint64_t lost = 0;    // clients that fell silent
  std::uint64_t unsent = 0;  // forces that the system did not take
};

class BridgeDevice : public Device {
 public:
  static constexpr int most_packets = 16; // taken at a tick, of the client that holds the tool
  static constexpr int most_others = 4;   // of anyone else, while there is one; without one, most_packets

  /// Binds the sockets. `waiting`: where the tool is until a client moves it. Throws InputError naming address, port
  /// and the system's reason.
  BridgeDevice(const BridgeSettings& settings, const PathPose& waiting, double rate);
  ~BridgeDevice() override;
  BridgeDevice(const BridgeDevice&) = delete;
  BridgeDevice& operator=(const BridgeDevice&) = delete;

  /// The newest pose of the client that holds the tool, or where the loop has it on the way there (client_pace.hpp).
  /// Not connected: nobody does; the tool stays where it was.
  DeviceState read(std::uint64_t tick) noexcept override;
  /// Sends the force to that client, and the torque if it speaks of one (its version).
  void apply(const Vector3& force) noexcept override { render(force, Vector3::Zero()); }
  void render(const Vector3& force, const Vector3& torque) noexcept override;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// From any thread.
  [[nodiscard]] PaceReading pace() const noexcept { return pace_watch_.shown(); }
  /// From the haptic thread, or after it has ended.
  [[nodiscard]] const BridgeCounters& counters() const { return counters_; }

 private:
  struct Socket; // and what the system fills in, made once
  void take_from(int descriptor, int most) noexcept;
  void take(std::size_t packet) noexcept;
  void release() noexcept;
  [[nodiscard]] std::uint64_t token_for(const sockaddr_in& from) const noexcept;
  void reply(const sockaddr_in& to, std::uint64_t token, std::uint16_t version, const Vector3& force,
             const Vector3& torque) noexcept;

  std::unique_ptr<Socket> socket_;
  double rate_, timeout_;
  std::uint64_t silence_; // ticks after which a client is gone
  std::uint16_t port_ = 0;
  DeviceState state_;
  bool held_ = false, posed_ = false;  // by a client; whose pose has been taken
  std::array<std::uint64_t, 2> key_{}; // of the tokens
  std::uint64_t sessions_ = 0;         // that have begun
  std::uint64_t token_ = 0, sequence_ = 0, heard_ = 0;
  std::uint16_t version_ = 1; // of the client that holds the tool
  ClientPace pace_;
  PaceWatch pace_watch_;
  BridgeCounters counters_;
};

} // namespace spherecut::app
