#include "src/scenario/haptic_settings.hpp"

#include "topology/base/errors.hpp"

#include <charconv>
#include <fmt/format.h>

namespace spherecut::app {

std::string_view to_string(ForceModelKind kind) {
  switch (kind) {
  case ForceModelKind::hold:
    return "hold";
  case ForceModelKind::linear_in_time:
    return "linear_in_time";
  case ForceModelKind::tangent:
    return "tangent";
  }
  return "unknown";
}

ForceModelKind force_model_from_string(std::string_view name) {
  for (const ForceModelKind kind : {ForceModelKind::hold, ForceModelKind::linear_in_time, ForceModelKind::tangent})
    if (name == to_string(kind))
      return kind;
  throw InputError(fmt::format("force model '{}' does not exist; there are: hold, linear_in_time, tangent", name));
}

std::optional<WebSocketAddress> websocket_address(std::string_view text) {
  constexpr std::string_view scheme = "ws://";
  if (text.substr(0, scheme.size()) != scheme)
    return std::nullopt;
  text.remove_prefix(scheme.size());
  const std::size_t slash = text.find('/');
  WebSocketAddress address;
  if (slash != std::string_view::npos)
    address.path = text.substr(slash);
  std::string_view place = text.substr(0, slash);
  const std::size_t colon = place.rfind(':');
  if (colon == std::string_view::npos || colon == 0)
    return std::nullopt;
  const std::string_view digits = place.substr(colon + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), address.port);
  if (error != std::errc() || end != digits.data() + digits.size() || address.port < 1 || address.port > 65535)
    return std::nullopt;
  place = place.substr(0, colon);
  const bool bracketed = place.size() > 2 && place.front() == '[' && place.back() == ']';
  address.host = bracketed ? place.substr(1, place.size() - 2) : place;
  const bool odd = address.host.find_first_of(bracketed ? "[]@ \t" : ":[]@ \t") != std::string::npos ||
                   address.path.find_first_of(" \t") != std::string::npos;
  return odd ? std::nullopt : std::optional(address);
}

} // namespace spherecut::app
