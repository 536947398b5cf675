#include "src/output/columns.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

std::string quoted_text(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  std::string out = "\"";
  for (const char c : text)
    out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

} // namespace

std::string component_name(std::string_view name, int component) {
  std::string out(name);
  return out.replace(out.find('*'), 1, 1, "xyz"[component]);
}

void append_name(std::string& line, std::string_view name, bool is_vector) {
  for (int k = 0; k < (is_vector ? 3 : 1); ++k) {
    line += line.empty() ? "" : ",";
    line += is_vector ? component_name(name, k) : std::string(name);
  }
}

void append_cell(std::string& line, const Cell& cell, std::string_view format) {
  const auto number = [&](double value) { return fmt::format(fmt::runtime(format), value); };
  line += line.empty() ? "" : ",";
  if (const auto* yes = std::get_if<bool>(&cell))
    line += *yes ? "1" : "0";
  else if (const auto* count = std::get_if<std::int64_t>(&cell))
    line += fmt::format("{}", *count);
  else if (const auto* value = std::get_if<double>(&cell))
    line += number(*value);
  else if (const auto* vector = std::get_if<Vector3>(&cell))
    line += fmt::format("{},{},{}", number(vector->x()), number(vector->y()), number(vector->z()));
  else if (const auto* text = std::get_if<std::string>(&cell))
    line += format == "quoted" ? quoted_text(*text) : *text;
  else
    for (std::size_t k = 0; k < std::get<std::vector<double>>(cell).size(); ++k)
      line += (k == 0 ? "" : ";") + number(std::get<std::vector<double>>(cell)[k]);
}

} // namespace spherecut::app
