#include "src/haptic_settings.hpp"

#include "topology/errors.hpp"

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

} // namespace spherecut::app
