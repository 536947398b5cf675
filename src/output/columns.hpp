// Columns of the tables that a run writes. A column is one entry: its name with the unit, its format and its value of a
// row. The CSV files and the Python package are both made from the entries.
#pragma once

#include "topology/base/types.hpp"

#include <concepts>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace spherecut::app {

/// What a row has in a column.
using Cell = std::variant<bool, std::int64_t, double, Vector3, std::string, std::vector<double>>;

Cell count(std::integral auto number) {
  return static_cast<std::int64_t>(number);
}

template <class Row>
struct Column {
  /// With the unit at its end. That of a vector has a star, where x, y and z go: "force_*_N" makes three columns.
  std::string_view name;
  /// Of fmt, for floating-point numbers, "{:.9g}"; of text either "quoted" or empty.
  std::string_view format;
  Cell (*value)(const Row& row);
};

/// The name of component 0, 1 or 2 of a vector's column.
std::string component_name(std::string_view name, int component);

/// Adds the name as the first line of a CSV file has it.
void append_name(std::string& line, std::string_view name, bool is_vector);
/// Adds the value as a row of a CSV file has it: 1 and 0 for true and false, the numbers of a list between semicolons.
void append_cell(std::string& line, const Cell& cell, std::string_view format);

/// First line of a CSV file, with its end of line.
template <class Row>
std::string header_line(std::span<const Column<Row>> columns) {
  std::string line;
  for (const Column<Row>& column : columns)
    append_name(line, column.name, column.name.find('*') != std::string_view::npos);
  return line + "\n";
}

/// A row of it, with its end of line.
template <class Row>
std::string csv_line(std::span<const Column<Row>> columns, const Row& row) {
  std::string line;
  for (const Column<Row>& column : columns)
    append_cell(line, column.value(row), column.format);
  return line + "\n";
}

} // namespace spherecut::app
