// The [haptics] part of a scenario: rates, force model, and the device with its limits.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace spherecut::app {

enum class ForceModelKind {
  hold,           // the force of the last solve
  linear_in_time, // the line through the last two solves [De 2001, sec. 4, "force extrapolation"]
  tangent,        // the contact of the last solve's condensed body with the tool where it is now
};
std::string_view to_string(ForceModelKind kind);
/// Throws InputError naming the value and the three allowed names.
ForceModelKind force_model_from_string(std::string_view name);

/// What a device can take. The defaults are those of a small desktop device with three motors.
struct DeviceLimits {
  double gain = 1;            // force on the hand per force of the tissue
  double force = 3.3;         // N, saturation
  double slew = 500;          // N/s, of the whole force vector
  double torque = 0.1;        // N m, saturation; from none to it takes as long as from none to that of the force
  double stiffness = 1000;    // N/m, the stiffest contact it renders steadily
  double damping = 5;         // N s/m, most that the controller may add
  double resolution = 5.5e-5; // m, of its position sensor
  int delay = 0;              // ticks by which a force acts late, at most 15
};

/// A hand that holds the device by spring and damper, and moves their other end along a path.
struct HandSettings {
  double mass = 0.1;      // kg, of device and hand
  double stiffness = 300; // N/m, towards the path
  double damping = 5;     // N s/m, against the path's velocity
  double resolution = 0;  // m, of the position sensor; 0: exact
  int delay = 0;          // ticks by which a force acts late
  bool rides_path = true; // false: stays put until pushed (the path's first pose is its target)
};

enum class HeldDevice {
  script,    // follows the scenario's path whatever the force
  hand,      // mass, spring and damper on that path
  recording, // follows what a device did in a recorded session
  bridge,    // whatever a client behind a socket holds
  haply,     // an Inverse3 behind its maker's WebSocket service
};

/// Where clients with real hardware find the loop (docs/haptic_bridge.md).
struct BridgeSettings {
  std::string address = "127.0.0.1"; // of this machine, IPv4, that the socket is bound to
  int port = 27510;                  // 0: one that is free
  double timeout = 0.1;              // s without a pose after which a client has gone
};

/// Where a WebSocket is found.
struct WebSocketAddress {
  std::string host; // a name or an IP address, IPv6 without its brackets
  int port = 0;
  std::string path = "/";
};
/// Of ws://HOST:PORT or ws://HOST:PORT/PATH [RFC 6455, 3]; none where it is not of that form. The port must be there.
std::optional<WebSocketAddress> websocket_address(std::string_view text);

/// The service of an Inverse3 (docs/devices.md).
struct HaplySettings {
  std::string address = "ws://localhost:10001";
  std::string device_id; // of the Inverse3; empty: the first that the service has
  double timeout = 0.1;  // s without a pose after which the device has gone
};

/// The device of a second hand, which holds the blade beside the tool in the first. Limits, model and simulated hand
/// are those of the first.
struct SecondDevice {
  HeldDevice device = HeldDevice::hand; // not a recording: that of the first has both hands
  BridgeSettings bridge;
  HaplySettings haply;
};

struct HapticSettings {
  double rate = 1000; // ticks per second
  ForceModelKind model = ForceModelKind::tangent;
  double hand_over = 0.02; // s, in which the difference at a new solve fades
  double budget = 0.01;    // s, that a solve should take
  bool passivity = true;   // the controller; the observer is always on
  double viewer_rate = 60; // frames per second at most
  HeldDevice device = HeldDevice::hand;
  std::filesystem::path recording; // of the device of that name
  BridgeSettings bridge;
  HaplySettings haply;
  DeviceLimits limits;
  HandSettings hand;
  std::optional<SecondDevice> second; // none: one hand, beside which a blade keeps to its path
};

} // namespace spherecut::app
