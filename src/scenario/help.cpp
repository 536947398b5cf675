// The table of keys as text for a terminal and as Markdown.
#include "src/scenario/keys.hpp"

#include <fmt/format.h>

namespace spherecut::app {
namespace {

using enum KeyKind;

bool is_table(const ScenarioKey& key) {
  return key.kind == table || key.kind == array_of_tables;
}

std::string heading(const ScenarioKey& key) {
  return key.kind == table ? fmt::format("[{}]", key.path) : fmt::format("[[{}]]", key.path);
}

std::string type_and_unit(const ScenarioKey& key) {
  return key.unit.empty() ? std::string(type_name(key.kind)) : fmt::format("{}, {}", type_name(key.kind), key.unit);
}

std::string fallback_text(const ScenarioKey& key) {
  return key.fallback.empty() ? "see meaning" : std::string(key.fallback);
}

} // namespace

std::string_view type_name(KeyKind kind) {
  switch (kind) {
  case table:
    return "table";
  case array_of_tables:
    return "array of tables";
  case number:
    return "number";
  case integer:
    return "integer";
  case boolean:
    return "boolean";
  case text:
  case choice:
    return "string";
  case vector:
    return "[x, y, z]";
  case points:
    return "array of [x, y, z]";
  case strain:
    return "three or six numbers";
  case axes:
    return "array of strings";
  }
  return "";
}

std::string scenario_help() {
  std::string out = "A scenario is a TOML file in SI units: metres, newtons, pascals, seconds, kilograms.\n";
  const auto list = [&](std::string_view parent) {
    for (const ScenarioKey& key : scenario_keys()) {
      if (is_table(key) || table_of(key.path) != parent)
        continue;
      out += fmt::format("  {:<18} {}", leaf_of(key.path), type_and_unit(key));
      if (const std::string allowed = allowed_values(key); !allowed.empty())
        out += fmt::format("; {}", allowed);
      if (!key.fallback.empty())
        out += key.fallback == "required" ? "; required" : fmt::format("; default {}", key.fallback);
      if (!key.when.empty())
        out += fmt::format("; with {}", key.when);
      out += fmt::format("\n  {:<18}   {}\n", "", key.meaning);
    }
  };
  list("");
  for (const ScenarioKey& key : scenario_keys())
    if (is_table(key)) {
      out += fmt::format("\n{}  {}{}\n", heading(key), key.meaning, key.fallback == "required" ? " Required." : "");
      list(key.kind == array_of_tables ? fmt::format("{}[]", key.path) : std::string(key.path));
    }
  return out;
}

std::string scenario_reference() {
  std::string out;
  const auto list = [&](std::string_view parent) {
    out += "| key | type, unit | allowed | default | meaning |\n|---|---|---|---|---|\n";
    for (const ScenarioKey& key : scenario_keys()) {
      if (is_table(key) || table_of(key.path) != parent)
        continue;
      std::string meaning(key.meaning);
      if (!key.when.empty())
        meaning += fmt::format(" With `{}`.", key.when);
      out += fmt::format("| `{}` | {} | {} | {} | {} |\n", leaf_of(key.path), type_and_unit(key), allowed_values(key),
                         fallback_text(key), meaning);
    }
  };
  out += "### Top level\n\n";
  list("");
  for (const ScenarioKey& key : scenario_keys())
    if (is_table(key)) {
      out += fmt::format("\n### `{}`\n\n{}{}\n\n", heading(key), key.meaning,
                         key.fallback == "required" ? " Required." : "");
      list(key.kind == array_of_tables ? fmt::format("{}[]", key.path) : std::string(key.path));
    }
  return out;
}

} // namespace spherecut::app
