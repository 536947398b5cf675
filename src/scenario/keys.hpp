// Every key of a scenario file in one table: the reader checks files against it, and the help and docs/scenario.md are
// written from it.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>

namespace spherecut::app {

enum class KeyKind {
  table,           // [organ]
  array_of_tables, // [[fixed]]
  number,          // integer or float, finite
  integer,
  boolean,
  text,
  choice, // one of ScenarioKey::choices
  vector, // array of three finite numbers
  points, // array of vectors, any number
  strain, // array of three or six finite numbers
  axes,   // array of distinct "x", "y", "z", not empty
};

inline constexpr double unbounded = std::numeric_limits<double>::infinity();

/// What numbers are allowed: lower <= value <= upper, or strict where `open`.
struct KeyRange {
  double lower = -unbounded, upper = unbounded;
  bool lower_open = false, upper_open = false;
  [[nodiscard]] bool holds(double value) const;
};

struct ScenarioKey {
  std::string_view path; // "material.density"; "fixed[].lower" inside an array of tables
  KeyKind kind = KeyKind::number;
  std::string_view unit;     // "m", "Pa", "" for a plain number
  std::string_view fallback; // value of a missing key as TOML text; "required"; "" where absence has its own meaning
  std::string_view meaning;  // one line; says what absence means where fallback is ""
  KeyRange range{};
  std::string_view choices{}; // "block, cylinder"
  std::string_view when{};    // "shape = block, cylinder": only beside these values of a sibling key
};

std::span<const ScenarioKey> scenario_keys();

/// What a value of this kind is: "number", "[x, y, z]".
std::string_view type_name(KeyKind kind);

/// The entry of a path, or nullptr.
const ScenarioKey* find_scenario_key(std::string_view path);

/// Parts of a path: "tool.path[]" and "time" for "tool.path[].time"; the table is "" at top level.
std::string_view table_of(std::string_view path);
std::string_view leaf_of(std::string_view path);

/// The path of a key in a table.
std::string joined_path(std::string_view table, std::string_view key);

/// "0 <= value < 0.5", "one of: block, cylinder", "three numbers"; empty when anything goes.
std::string allowed_values(const ScenarioKey& key);

/// All keys for a terminal.
std::string scenario_help();

/// All keys as Markdown tables, one for each table of the file: the reference part of docs/scenario.md.
std::string scenario_reference();

} // namespace spherecut::app
