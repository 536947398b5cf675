#include "experiments/gaping/reference.hpp"

#include "gaping/reference_table.hpp" // made by CMake
#include "topology/base/errors.hpp"

#include <cstdlib>
#include <fmt/format.h>
#include <map>
#include <sstream>

namespace spherecut::experiments {

namespace {

double gaping_number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || end != text.c_str() + text.size())
    throw InputError(fmt::format("gaping table: '{}' is not a number", text));
  return value;
}

} // namespace

// Comment lines "# key: value", one header line, then x,z,opening_20,opening_40,coarse_opening_20,coarse_opening_40.
GapingReference load_gaping_reference() {
  GapingReference table;
  std::map<std::string, std::string> told;
  for (const int percent : {20, 40})
    table.stretches.push_back({1 + 0.01 * percent});
  std::istringstream lines{std::string(gaping_table)};
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# ")) {
      const std::size_t colon = line.find(": ");
      if (colon != std::string::npos)
        told[line.substr(2, colon - 2)] = line.substr(colon + 2);
      continue;
    }
    if (line.empty() || line.starts_with("x,"))
      continue;
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');)
      row.push_back(gaping_number(cell));
    if (row.size() != 6)
      throw InputError(fmt::format("gaping table: line '{}' (must have six columns)", line));
    for (std::size_t k = 0; k < 2; ++k)
      table.stretches[k].places.push_back({row[0], row[1], row[2 + k], row[4 + k]});
  }
  table.source = told["source"];
  for (std::size_t k = 0; k < 2; ++k) {
    const std::string percent = k == 0 ? "20" : "40";
    table.stretches[k].force = gaping_number(told["force_" + percent]);
    table.stretches[k].force_change = gaping_number(told["force_change_" + percent]);
    table.stretches[k].opening_change = gaping_number(told["opening_change_" + percent]);
  }
  return table;
}

} // namespace spherecut::experiments
