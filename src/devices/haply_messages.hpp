// Messages between the service of an Inverse3 and its clients, as text (docs/devices.md): pose in, force out. No
// sockets here.
#pragma once

#include "topology/base/types.hpp"

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace spherecut::app {

/// What the service says of an Inverse3 and of the grip on it.
struct HaplyPose {
  Vector3 cursor = Vector3::Zero();                         // m, in the frame of the service's application space
  Eigen::Quaterniond grip = Eigen::Quaterniond::Identity(); // of the first grip that has one
  bool has_grip = false;
  std::uint16_t buttons = 0; // of that grip: a, b, c; the one of a wired grip counts as a
};

enum class HaplyMessage : std::uint8_t {
  garbage,   // not JSON of the documented form, or with a number that is none or is out of range
  no_device, // well formed, without the device asked for
  pose,
};

/// Reads a state of the service. `device_id` empty: of the first Inverse3. Fills `pose` in for a pose alone.
HaplyMessage read_haply_message(std::string_view text, std::string_view device_id, HaplyPose& pose);

/// Ids of the Inverse3s in a state, in its order; none in garbage.
std::vector<std::string> haply_devices(std::string_view text);

/// A force on the cursor, N. The service answers every message with one state, so this also asks for the next. `first`:
/// of the session, which it then names.
std::string haply_force_message(std::string_view device_id, const Vector3& force, bool first);

} // namespace spherecut::app
