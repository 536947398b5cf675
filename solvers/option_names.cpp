// Names of the options that scenarios choose among: one table each, read in both directions.
#include "solvers/contact/lip_contact.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <string>
#include <utility>

namespace spherecut::solvers {

namespace {

template <typename Option, std::size_t Count = 3>
using Names = std::array<std::pair<Option, std::string_view>, Count>;

constexpr Names<Method> methods{
    {{Method::published, "published"}, {Method::collocation, "collocation"}, {Method::galerkin, "galerkin"}}};
constexpr Names<UnheldPieces> treatments{
    {{UnheldPieces::refuse, "refuse"}, {UnheldPieces::hold, "hold"}, {UnheldPieces::drop, "drop"}}};
constexpr Names<SightRule, 4> sight_rules{{{SightRule::visibility, "visibility"},
                                           {SightRule::diffraction, "diffraction"},
                                           {SightRule::enriched, "enriched"},
                                           {SightRule::appended, "appended"}}};
constexpr Names<LipCondition> lip_conditions{
    {{LipCondition::open, "open"}, {LipCondition::frictionless, "frictionless"}, {LipCondition::sticking, "sticking"}}};

template <typename Option, std::size_t Count>
std::string_view name_of(const Names<Option, Count>& names, Option option) {
  const auto at = std::find_if(names.begin(), names.end(), [&](const auto& entry) { return entry.first == option; });
  return at != names.end() ? at->second : "unknown";
}

template <typename Option, std::size_t Count>
Option option_of(const Names<Option, Count>& names, std::string_view name, const std::string& refusal) {
  const auto at = std::find_if(names.begin(), names.end(), [&](const auto& entry) { return entry.second == name; });
  if (at == names.end()) {
    std::string allowed;
    for (const auto& entry : names)
      allowed += fmt::format("{}{}", allowed.empty() ? "" : ", ", entry.second);
    throw InputError(fmt::format("{}; there are: {}", refusal, allowed));
  }
  return at->first;
}

} // namespace

std::string_view to_string(Method method) {
  return name_of(methods, method);
}
Method method_from_string(std::string_view name) {
  return option_of(methods, name, fmt::format("method '{}' does not exist", name));
}
bool wants_ring_ahead(Method method) {
  return method != Method::galerkin;
}

std::string_view to_string(UnheldPieces treatment) {
  return name_of(treatments, treatment);
}
UnheldPieces unheld_pieces_from_string(std::string_view name) {
  return option_of(treatments, name, fmt::format("'{}' for pieces that nothing holds", name));
}

std::string_view to_string(SightRule rule) {
  return name_of(sight_rules, rule);
}
SightRule sight_rule_from_string(std::string_view name) {
  return option_of(sight_rules, name, fmt::format("sight rule '{}' does not exist", name));
}

std::string_view to_string(LipCondition condition) {
  return name_of(lip_conditions, condition);
}
LipCondition lip_condition_from_string(std::string_view name) {
  return option_of(lip_conditions, name, fmt::format("lip contact '{}' does not exist", name));
}

} // namespace spherecut::solvers
