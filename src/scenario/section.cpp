// Values of a checked scenario: from the file, or the fallback in the table of keys.
#include "src/scenario/document.hpp"

#include <cstdint>
#include <fmt/format.h>
#include <stdexcept>
#include <toml++/toml.h>

namespace spherecut::app {

namespace {

Vector3 vector_of(const toml::array& array) {
  return {array.get(0)->value<double>().value(), array.get(1)->value<double>().value(),
          array.get(2)->value<double>().value()};
}

} // namespace

struct Section::Value {
  const toml::node* node = nullptr;
  std::optional<toml::table> fallback{}; // owns the node when it is a fallback
};

Section::Value Section::find(std::string_view key) const {
  Value value;
  if (table_ != nullptr)
    value.node = static_cast<const toml::table*>(table_)->get(key);
  const ScenarioKey* entry = find_scenario_key(joined_path(path_, key));
  if (entry == nullptr)
    throw std::logic_error(fmt::format("scenario key '{}' is not in the table of keys", joined_path(path_, key)));
  if (value.node == nullptr && !entry->fallback.empty() && entry->fallback != "required") {
    value.fallback = toml::parse(fmt::format("value = {}", entry->fallback));
    value.node = value.fallback->get("value");
  }
  return value;
}

Section::Value Section::require(std::string_view key) const {
  Value value = find(key);
  if (value.node == nullptr)
    throw std::logic_error(fmt::format("scenario key '{}' is absent and has no default", joined_path(path_, key)));
  return value;
}

bool Section::has(std::string_view key) const {
  return table_ != nullptr && static_cast<const toml::table*>(table_)->contains(key);
}

double Section::number(std::string_view key) const {
  return require(key).node->value<double>().value();
}

std::optional<double> Section::optional_number(std::string_view key) const {
  const Value value = find(key);
  return value.node == nullptr ? std::nullopt : value.node->value<double>();
}

long Section::integer(std::string_view key) const {
  return require(key).node->value<std::int64_t>().value();
}

std::optional<long> Section::optional_integer(std::string_view key) const {
  const Value value = find(key);
  if (value.node == nullptr)
    return std::nullopt;
  return value.node->value<std::int64_t>().value();
}

bool Section::boolean(std::string_view key) const {
  return require(key).node->value<bool>().value();
}

std::string Section::text(std::string_view key) const {
  return require(key).node->value<std::string>().value();
}

Vector3 Section::vector(std::string_view key) const {
  const Value value = require(key);
  return vector_of(*value.node->as_array());
}

std::vector<Vector3> Section::points(std::string_view key) const {
  const Value value = require(key);
  std::vector<Vector3> all;
  for (const toml::node& point : *value.node->as_array())
    all.push_back(vector_of(*point.as_array()));
  return all;
}

Matrix3 Section::strain(std::string_view key) const {
  const Value value = require(key);
  const toml::array& array = *value.node->as_array();
  Matrix3 tensor = vector_of(array).asDiagonal();
  if (array.size() == 6) {
    tensor(1, 2) = tensor(2, 1) = array.get(3)->value<double>().value();
    tensor(0, 2) = tensor(2, 0) = array.get(4)->value<double>().value();
    tensor(0, 1) = tensor(1, 0) = array.get(5)->value<double>().value();
  }
  return tensor;
}

std::array<bool, 3> Section::axes(std::string_view key) const {
  const Value value = require(key);
  std::array<bool, 3> held{false, false, false};
  for (const toml::node& entry : *value.node->as_array())
    held[static_cast<std::size_t>(entry.value<std::string_view>().value().front() - 'x')] = true;
  return held;
}

Section Section::table(std::string_view key) const {
  Section inner;
  inner.document_ = document_;
  inner.path_ = joined_path(path_, key);
  if (const toml::node* node = has(key) ? static_cast<const toml::table*>(table_)->get(key) : nullptr)
    inner.table_ = node->as_table();
  return inner;
}

std::vector<Section> Section::tables(std::string_view key) const {
  std::vector<Section> all;
  if (!has(key))
    return all;
  for (const toml::node& node : *static_cast<const toml::table*>(table_)->get(key)->as_array()) {
    Section inner;
    inner.document_ = document_;
    inner.path_ = joined_path(path_, key) + "[]";
    inner.table_ = node.as_table();
    all.push_back(std::move(inner));
  }
  return all;
}

long Section::line(std::string_view key) const {
  if (table_ == nullptr)
    return 0;
  const auto* table = static_cast<const toml::table*>(table_);
  const toml::node* node = key.empty() ? nullptr : table->get(key);
  return (node == nullptr ? *table : *node).source().begin.line;
}

Vector3 direction(const Section& section, std::string_view name, std::string_view key, Offences& offences) {
  const Vector3 value = section.vector(key);
  if (!value.isZero(0))
    return value.stableNormalized();
  offences.add(section.line(key), fmt::format("{} = [0, 0, 0]: has no direction; allowed: any other vector", name));
  return Vector3::Zero();
}

} // namespace spherecut::app
