#include "src/devices/haply_messages.hpp"

#include "src/devices/bridge_protocol.hpp"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

namespace spherecut::app {
namespace {

using nlohmann::json;

// Of an object; null where there is none.
const json* part(const json& whole, const char* key) {
  if (!whole.is_object())
    return nullptr;
  const auto found = whole.find(key);
  return found == whole.end() ? nullptr : &*found;
}

template <std::size_t count>
std::optional<std::array<double, count>> numbers(const json* object, const std::array<const char*, count>& keys) {
  std::array<double, count> values{};
  for (std::size_t i = 0; i < count; ++i) {
    const json* value = object != nullptr ? part(*object, keys[i]) : nullptr;
    if (value == nullptr || !value->is_number())
      return std::nullopt;
    values[i] = value->get<double>();
    if (!(std::abs(values[i]) <= bridge_farthest))
      return std::nullopt;
  }
  return values;
}

// The text under an entry's device_id; null: it has none.
const std::string* id_of(const json& device) {
  const json* id = part(device, "device_id");
  return id != nullptr ? id->get_ptr<const std::string*>() : nullptr;
}

std::uint16_t buttons_of(const json& state) {
  std::uint16_t pressed = 0;
  const auto add = [&](const json* button, unsigned bit) {
    if (button != nullptr && button->is_boolean() && button->get<bool>())
      pressed = static_cast<std::uint16_t>(pressed | 1U << bit);
  };
  if (const json* buttons = part(state, "buttons")) {
    add(part(*buttons, "a"), 0);
    add(part(*buttons, "b"), 1);
    add(part(*buttons, "c"), 2);
  }
  add(part(state, "button"), 0);
  return pressed;
}

void read_grip(const json& message, HaplyPose& pose) {
  for (const char* kind : {"wireless_verse_grip", "verse_grip"}) {
    const json* grips = part(message, kind);
    if (grips == nullptr || !grips->is_array())
      continue;
    for (const json& grip : *grips) {
      const json* state = part(grip, "state");
      if (state == nullptr)
        continue;
      const auto turn = numbers<4>(part(*state, "orientation"), {"w", "x", "y", "z"});
      if (!turn)
        continue;
      const Eigen::Quaterniond orientation((*turn)[0], (*turn)[1], (*turn)[2], (*turn)[3]);
      if (!(std::abs(orientation.norm() - 1) < 0.01))
        continue;
      pose.grip = orientation.normalized();
      pose.has_grip = true;
      pose.buttons = buttons_of(*state);
      return;
    }
  }
}

json parsed(std::string_view text) {
  return json::parse(text.begin(), text.end(), nullptr, false);
}

} // namespace

HaplyMessage read_haply_message(std::string_view text, std::string_view device_id, HaplyPose& pose) {
  const json message = parsed(text);
  const json* devices = part(message, "inverse3");
  if (!message.is_object() || (devices != nullptr && !devices->is_array()))
    return HaplyMessage::garbage;
  if (devices == nullptr)
    return HaplyMessage::no_device;
  for (const json& device : *devices) {
    const std::string* id = id_of(device);
    if (id == nullptr)
      return HaplyMessage::garbage;
    if (!device_id.empty() && *id != device_id)
      continue;
    const json* state = part(device, "state");
    const auto place = numbers<3>(state != nullptr ? part(*state, "cursor_position") : nullptr, {"x", "y", "z"});
    if (!place)
      return HaplyMessage::garbage;
    pose = {};
    pose.cursor = {(*place)[0], (*place)[1], (*place)[2]};
    read_grip(message, pose);
    return HaplyMessage::pose;
  }
  return HaplyMessage::no_device;
}

std::vector<std::string> haply_devices(std::string_view text) {
  std::vector<std::string> ids;
  const json message = parsed(text);
  const json* devices = part(message, "inverse3");
  if (devices == nullptr || !devices->is_array())
    return ids;
  for (const json& device : *devices)
    if (const std::string* id = id_of(device))
      ids.push_back(*id);
  return ids;
}

std::string haply_force_message(std::string_view device_id, const Vector3& force, bool first) {
  json message = {
      {"inverse3",
       json::array(
           {{{"device_id", device_id},
             {"commands",
              {{"set_cursor_force", {{"vector", {{"x", force.x()}, {"y", force.y()}, {"z", force.z()}}}}}}}}})}};
  if (first)
    message["session"] = {{"configure", {{"profile", {{"name", "org.spherecut:haptics"}}}}}};
  return message.dump();
}

} // namespace spherecut::app
