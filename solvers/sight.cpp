#include "solvers/sight.hpp"

#include "topology/errors.hpp"

#include <fmt/format.h>

namespace spherecut::solvers {

std::string_view to_string(SightRule rule) {
  switch (rule) {
  case SightRule::visibility:
    return "visibility";
  case SightRule::diffraction:
    return "diffraction";
  case SightRule::enriched:
    return "enriched";
  }
  return "unknown";
}

SightRule sight_rule_from_string(std::string_view name) {
  for (SightRule rule : {SightRule::visibility, SightRule::diffraction, SightRule::enriched})
    if (name == to_string(rule))
      return rule;
  throw InputError(fmt::format("sight rule '{}' does not exist; there are: visibility, diffraction, enriched", name));
}

} // namespace spherecut::solvers
