#include "experiments/hemisphere_palpation/reference.hpp"

#include "hemisphere_palpation/reference_tables.hpp" // made by CMake
#include "topology/base/errors.hpp"

#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

double number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw InputError(fmt::format("hemisphere table: '{}' is not a number", text));
  return value;
}

/// The table of one file: comment lines "# key: value", one header line, then angle,radial,axial.
HemisphereReference parse(std::string_view text) {
  HemisphereReference table;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.starts_with("# ")) {
      const std::size_t colon = line.find(": ");
      const std::string_view key = line.substr(2, colon - 2), value = line.substr(colon + 2);
      if (key == "source")
        table.source = value;
      else if (key == "poisson_ratio")
        table.poisson_ratio = number(value);
      else if (key == "force")
        table.force = number(value);
      else if (key == "force_change")
        table.force_change = number(value);
      else if (key == "surface_change")
        table.surface_change = number(value);
      continue;
    }
    const std::size_t first = line.find(','), second = line.find(',', first + 1);
    if (line.empty() || line.starts_with("angle"))
      continue;
    if (second == std::string_view::npos)
      throw InputError(fmt::format("hemisphere table: line '{}' (must have three columns)", line));
    table.angle.push_back(number(line.substr(0, first)));
    table.radial.push_back(number(line.substr(first + 1, second - first - 1)));
    table.axial.push_back(number(line.substr(second + 1)));
  }
  return table;
}

} // namespace

HemisphereReference load_hemisphere_reference(double poisson_ratio) {
  std::string stored;
  for (const std::string_view text : hemisphere_tables) {
    HemisphereReference table = parse(text);
    if (std::abs(table.poisson_ratio - poisson_ratio) < 1e-9)
      return table;
    stored += fmt::format("{}{}", stored.empty() ? "" : ", ", table.poisson_ratio);
  }
  throw InputError(
      fmt::format("hemisphere reference: no table for Poisson's ratio {} (stored: {})", poisson_ratio, stored));
}

} // namespace spherecut::experiments
