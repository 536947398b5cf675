#include "src/scenario/document.hpp"

#include "src/scenario/toml_limits.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <numeric>
#include <sstream>
#include <toml++/toml.h>

namespace spherecut::app {
namespace {

constexpr std::size_t most_entries = 10'000; // of an array
constexpr std::size_t most_told = 50;        // offences

long line_of(const toml::node& node) {
  return node.source().begin.line;
}

std::string whole_text(const toml::node& node) {
  if (node.is_table())
    return "a table";
  if (const toml::array* array = node.as_array()) {
    std::string text;
    for (const toml::node& entry : *array)
      text += (text.empty() ? "" : ", ") + whole_text(entry);
    return "[" + text + "]";
  }
  if (node.is_floating_point()) // the shortest text that reads back the same, where toml++ writes 17 digits
    return fmt::format("{}", node.value_or(0.0));
  std::ostringstream out;
  node.visit([&](const auto& value) { out << value; });
  return out.str();
}

std::string shown(const toml::node& node) {
  std::string text = whole_text(node);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.size() > 60 ? text.substr(0, 57) + "..." : text;
}

std::string_view wanted(const ScenarioKey& key) {
  switch (key.kind) {
  case KeyKind::table:
    return "a table";
  case KeyKind::array_of_tables:
    return "an array of tables";
  case KeyKind::number:
    return "a number";
  case KeyKind::integer:
    return "a whole number";
  case KeyKind::boolean:
    return "true or false";
  case KeyKind::text:
  case KeyKind::choice:
    return "a string";
  case KeyKind::vector:
    return "an array of three numbers";
  case KeyKind::points:
    return "an array of points, each three numbers";
  case KeyKind::strain:
    return "an array of three or six numbers";
  case KeyKind::axes:
    return "an array of strings";
  }
  return "";
}

std::string_view unit_name(std::string_view unit) {
  if (unit == "m")
    return "metres";
  if (unit == "Pa")
    return "pascals";
  if (unit == "s")
    return "seconds";
  return unit;
}

// Edits (insert, delete, replace) between two names, for "did you mean".
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

class Checker {
 public:
  explicit Checker(Offences& offences) : offences_(offences) {}

  // `path` as in scenario_keys(), `name` as the reader of a message knows the table: "fixed[2]".
  void table(const toml::table& table, const std::string& path, const std::string& name) {
    for (const auto& [key, node] : table) {
      const ScenarioKey* entry = find_scenario_key(joined_path(path, key.str()));
      if (entry == nullptr)
        unknown(path, name, key.str(), node);
      else
        value(*entry, joined_path(name, key.str()), node);
    }
    for (const ScenarioKey& key : scenario_keys())
      if (table_of(key.path) == path)
        presence(key, table, path, name);
  }

 private:
  void unknown(const std::string& path, const std::string& name, std::string_view key, const toml::node& node) {
    std::string known;
    std::string_view nearest;
    std::size_t distance = 4;
    for (const ScenarioKey& entry : scenario_keys()) {
      if (table_of(entry.path) != path)
        continue;
      known += (known.empty() ? "" : ", ") + std::string(leaf_of(entry.path));
      if (const std::size_t d = edit_distance(key, leaf_of(entry.path)); d < distance) {
        distance = d;
        nearest = leaf_of(entry.path);
      }
    }
    const std::string hint = nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
    offences_.add(line_of(node), fmt::format("unknown key '{}'{} Allowed here: {}", joined_path(name, key),
                                             hint.empty() ? "." : hint, known));
  }

  void wrong_type(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    std::string what = fmt::format("{} = {}: must be {}", name, shown(node), wanted(key));
    if (!key.unit.empty())
      what += fmt::format(" in {}, without the unit", unit_name(key.unit));
    if (const std::string allowed = allowed_values(key); !allowed.empty())
      what += fmt::format("; allowed: {}", allowed);
    offences_.add(line_of(node), what);
  }

  void out_of_range(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const std::string allowed = allowed_values(key);
    offences_.add(line_of(node),
                  fmt::format("{} = {}{}{}: out of range; allowed: {}", name, shown(node), key.unit.empty() ? "" : " ",
                              key.unit, allowed.empty() ? "finite numbers" : allowed));
  }

  void number(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const std::optional<double> value = node.value<double>();
    if (!node.is_number() || !value || (key.kind == KeyKind::integer && !node.is_integer()))
      wrong_type(key, name, node);
    else if (!std::isfinite(*value) || !key.range.holds(*value))
      out_of_range(key, name, node);
  }

  void choice(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const std::optional<std::string_view> value = node.value<std::string_view>();
    if (!value)
      wrong_type(key, name, node);
    else if (!in_list(key.choices, *value))
      out_of_range(key, name, node);
  }

  // False after a complaint about `node`, the value of the key or one of its points.
  bool numbers(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const toml::array* array = node.as_array();
    const bool size_fits =
        array != nullptr && (array->size() == 3 || (key.kind == KeyKind::strain && array->size() == 6));
    if (!size_fits ||
        !std::all_of(array->begin(), array->end(), [](const toml::node& entry) { return entry.is_number(); })) {
      wrong_type(key, name, node);
      return false;
    }
    for (const toml::node& entry : *array) {
      const double value = entry.value_or(std::nan(""));
      if (!std::isfinite(value) || !key.range.holds(value)) {
        out_of_range(key, name, node);
        return false;
      }
    }
    return true;
  }

  bool is_short(const toml::array& array, const std::string& name) {
    if (array.size() > most_entries)
      offences_.add(line_of(array),
                    fmt::format("{}: {} entries; allowed: at most {}", name, array.size(), most_entries));
    return array.size() <= most_entries;
  }

  void points(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr) {
      wrong_type(key, name, node);
      return;
    }
    if (!is_short(*array, name))
      return;
    std::size_t number = 1;
    for (const toml::node& point : *array)
      if (!numbers(key, fmt::format("{}[{}]", name, number++), point))
        return;
  }

  void axes(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const toml::array* array = node.as_array();
    std::string seen;
    bool good = array != nullptr && !array->empty();
    if (good)
      for (const toml::node& entry : *array) {
        const std::string axis = entry.value_or(std::string());
        good = good && in_list("x, y, z", axis) && seen.find(axis) == std::string::npos;
        seen += axis;
      }
    if (!good)
      wrong_type(key, name, node);
  }

  void tables(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr ||
        !std::all_of(array->begin(), array->end(), [](const toml::node& entry) { return entry.is_table(); })) {
      wrong_type(key, name, node);
      return;
    }
    if (!is_short(*array, name))
      return;
    for (std::size_t i = 0; i < array->size(); ++i)
      table(*array->get(i)->as_table(), fmt::format("{}[]", key.path), fmt::format("{}[{}]", name, i + 1));
  }

  void value(const ScenarioKey& key, const std::string& name, const toml::node& node) {
    switch (key.kind) {
    case KeyKind::table:
      if (const toml::table* inner = node.as_table())
        table(*inner, std::string(key.path), name);
      else
        wrong_type(key, name, node);
      break;
    case KeyKind::array_of_tables:
      tables(key, name, node);
      break;
    case KeyKind::number:
    case KeyKind::integer:
      number(key, name, node);
      break;
    case KeyKind::boolean:
      if (!node.is_boolean())
        wrong_type(key, name, node);
      break;
    case KeyKind::text:
      if (!node.is_string())
        wrong_type(key, name, node);
      break;
    case KeyKind::choice:
      choice(key, name, node);
      break;
    case KeyKind::vector:
    case KeyKind::strain:
      numbers(key, name, node);
      break;
    case KeyKind::points:
      points(key, name, node);
      break;
    case KeyKind::axes:
      axes(key, name, node);
      break;
    }
  }

  // Whether `key` belongs beside the value of the sibling that it names: yes, no, or unknown when that is bad itself.
  static std::optional<bool> applies(const ScenarioKey& key, const toml::table& table, const std::string& path) {
    if (key.when.empty())
      return true;
    const auto equals = key.when.find(" = ");
    const std::string_view sibling = key.when.substr(0, equals);
    std::optional<std::string_view> value = table[sibling].value<std::string_view>();
    const ScenarioKey* entry = find_scenario_key(joined_path(path, sibling));
    if (!table.contains(sibling) && entry != nullptr && entry->fallback.size() > 2 && entry->fallback.front() == '"')
      value = entry->fallback.substr(1, entry->fallback.size() - 2); // left out: its default, within quotes
    if (!value || entry == nullptr || !in_list(entry->choices, *value))
      return std::nullopt;
    return in_list(key.when.substr(equals + 3), *value);
  }

  void presence(const ScenarioKey& key, const toml::table& table, const std::string& path, const std::string& name) {
    const std::string_view own = leaf_of(key.path);
    const std::optional<bool> wanted_here = applies(key, table, path);
    const toml::node* node = table.get(own);
    if (node != nullptr && wanted_here == false)
      offences_.add(line_of(*node),
                    fmt::format("{} = {}: goes only with {}", joined_path(name, own), shown(*node), key.when));
    if (node == nullptr && wanted_here == true && key.fallback == "required") {
      std::string what = fmt::format("{} is missing: {}", joined_path(name, own), wanted(key));
      if (!key.unit.empty())
        what += fmt::format(" in {}", unit_name(key.unit));
      if (const std::string allowed = allowed_values(key); !allowed.empty())
        what += fmt::format("; allowed: {}", allowed);
      if (key.kind == KeyKind::table || key.kind == KeyKind::array_of_tables)
        what += fmt::format(". {}", key.meaning);
      offences_.add(std::max<long>(1, line_of(table)), what);
    }
  }

  static bool in_list(std::string_view list, std::string_view value) {
    while (!list.empty()) {
      const auto comma = list.find(", ");
      if (list.substr(0, comma) == value)
        return true;
      list = comma == std::string_view::npos ? std::string_view{} : list.substr(comma + 2);
    }
    return false;
  }

  Offences& offences_;
};

std::string read_text(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    throw InputError(fmt::format("{}: there is no such file", file.string()));
  if (std::filesystem::is_directory(status))
    throw InputError(fmt::format("{}: is a folder, not a scenario file", file.string()));
  std::ifstream in(file, std::ios::binary);
  std::string text;
  std::array<char, 65536> block{};
  while (in && text.size() <= largest_scenario) {
    in.read(block.data(), block.size());
    text.append(block.data(), static_cast<std::size_t>(in.gcount()));
  }
  if (!in.eof() && text.size() <= largest_scenario)
    throw InputError(fmt::format("{}: cannot be read", file.string()));
  if (text.size() > largest_scenario)
    throw InputError(fmt::format("{}: larger than {} bytes, not a scenario file", file.string(), largest_scenario));
  return text;
}

} // namespace

void Offences::add(long line, std::string what) {
  found_.emplace_back(line, std::move(what));
}

void Offences::throw_if_any() {
  if (found_.empty())
    return;
  std::stable_sort(found_.begin(), found_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string message;
  const std::size_t more = found_.size() - std::min(found_.size(), most_told);
  found_.resize(found_.size() - more);
  for (const auto& [line, what] : found_)
    message += fmt::format("{}{}:{}: {}", message.empty() ? "" : "\n", file_, line, what);
  if (more > 0)
    message += fmt::format("\nand {} more", more);
  throw InputError(message);
}

ScenarioDocument::ScenarioDocument(const std::filesystem::path& file) : ScenarioDocument(file, read_text(file)) {}

ScenarioDocument::ScenarioDocument(const std::filesystem::path& file, std::string text) : text_(std::move(text)) {
  Offences offences(file.string());
  auto document = std::make_shared<toml::table>();
  if (text_.size() > largest_scenario)
    throw InputError(fmt::format("{}: larger than {} bytes, not a scenario file", file.string(), largest_scenario));
  require_shallow_toml(text_, file.string());
  try {
    *document = toml::parse(text_, file.string());
  } catch (const toml::parse_error& error) {
    offences.add(error.source().begin.line, fmt::format("not TOML: {}", error.description()));
    offences.throw_if_any();
  }
  Checker(offences).table(*document, "", "");
  offences.throw_if_any();
  root_.table_ = document.get();
  root_.document_ = std::move(document);
}

} // namespace spherecut::app
