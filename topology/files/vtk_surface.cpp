#include "topology/files/vtk_surface.hpp"

#include "topology/base/errors.hpp"
#include "topology/files/surface_format.hpp"
#include "topology/files/vtk_cells.hpp"

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace spherecut::topology {

namespace {

/// Words, lines and numbers of a legacy file.
class VtkReader {
 public:
  VtkReader(const std::string& bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: byte {}: {}", name_, at_, what));
  }
  std::string line() {
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    std::string text = bytes_.substr(at_, end - at_);
    at_ = std::min(end + 1, bytes_.size());
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0)
      text.pop_back();
    return text;
  }
  /// The next word, in upper case; empty at the end.
  std::string word() {
    while (at_ < bytes_.size() && std::isspace(static_cast<unsigned char>(bytes_[at_])) != 0)
      ++at_;
    std::string text;
    while (at_ < bytes_.size() && std::isspace(static_cast<unsigned char>(bytes_[at_])) == 0 && text.size() < 64)
      text += static_cast<char>(std::toupper(static_cast<unsigned char>(bytes_[at_++])));
    return text;
  }
  std::int64_t count() {
    const std::string text = word();
    std::int64_t value = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || value < 0 || value > std::ssize(bytes_))
      fail(fmt::format("'{}' is no number of elements that can be true", text.substr(0, 24)));
    return value;
  }
  /// Numbers of a VTK type; binary ones begin on the next line.
  template <typename Number>
  std::vector<Number> numbers(std::int64_t count, const std::string& type, bool is_binary) {
    std::vector<Number> result;
    result.reserve(static_cast<std::size_t>(count));
    if (is_binary)
      line();
    for (std::int64_t i = 0; i < count; ++i)
      result.push_back(is_binary ? binary<Number>(type) : text<Number>());
    return result;
  }

 private:
  template <typename Number>
  Number text() {
    const std::string spelled = word();
    Number value{};
    const char* first = spelled.data() + (spelled.starts_with('+') ? 1 : 0);
    const auto [end, error] = std::from_chars(first, spelled.data() + spelled.size(), value);
    if (error != std::errc() || end != spelled.data() + spelled.size())
      fail(fmt::format("'{}' is no number", spelled.substr(0, 24)));
    return value;
  }
  template <typename Raw, typename Number>
  Number taken() {
    if (bytes_.size() - at_ < sizeof(Raw))
      fail("the file is cut short");
    std::array<char, sizeof(Raw)> raw;
    std::memcpy(raw.data(), bytes_.data() + at_, sizeof(Raw));
    at_ += sizeof(Raw);
    if constexpr (std::endian::native == std::endian::little) // legacy files are big-endian
      std::reverse(raw.begin(), raw.end());
    return static_cast<Number>(std::bit_cast<Raw>(raw));
  }
  template <typename Number>
  Number binary(const std::string& type) {
    if (type == "FLOAT")
      return taken<float, Number>();
    if (type == "DOUBLE")
      return taken<double, Number>();
    if (type == "INT" || type == "VTKTYPEINT32")
      return taken<std::int32_t, Number>();
    if (type == "LONG" || type == "VTKTYPEINT64" || type == "VTKIDTYPE")
      return taken<std::int64_t, Number>();
    fail(fmt::format("numbers of type '{}'; allowed: float, double, int, vtktypeint64", type));
  }

  const std::string& bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
};

/// POLYGONS or TRIANGLE_STRIPS, after that word.
void read_cells(VtkReader& reader, bool are_strips, bool is_binary, bool has_offsets, const std::string& name,
                PolygonSoup& soup) {
  const std::int64_t first = reader.count(), second = reader.count();
  std::vector<std::int64_t> ends, connectivity;
  if (has_offsets) { // since version 5.1
    if (reader.word() != "OFFSETS")
      reader.fail("OFFSETS are missing");
    const std::string offset_type = reader.word();
    ends = reader.numbers<std::int64_t>(first, offset_type, is_binary);
    if (reader.word() != "CONNECTIVITY")
      reader.fail("CONNECTIVITY is missing");
    const std::string type = reader.word();
    connectivity = reader.numbers<std::int64_t>(second, type, is_binary);
    if (!ends.empty())
      ends.erase(ends.begin());
  } else {
    const std::vector<std::int64_t> list = reader.numbers<std::int64_t>(second, "INT", is_binary);
    for (std::size_t at = 0; at < list.size();) {
      const std::int64_t corners = list[at++];
      if (corners < 0 || corners > std::ssize(list) - static_cast<std::int64_t>(at))
        reader.fail(fmt::format("a cell of {} corners where {} numbers are left", corners, list.size() - at));
      for (std::int64_t k = 0; k < corners; ++k)
        connectivity.push_back(list[at++]);
      ends.push_back(std::ssize(connectivity));
    }
    if (std::ssize(ends) != first)
      reader.fail(fmt::format("{} cells where {} are announced", ends.size(), first));
  }
  add_vtk_cells(connectivity, ends, are_strips, 0, std::ssize(soup.vertices), name, soup);
}

} // namespace

void add_vtk_cells(std::span<const std::int64_t> connectivity, std::span<const std::int64_t> ends, bool are_strips,
                   std::int64_t base, std::int64_t points, const std::string& name, PolygonSoup& soup) {
  std::int64_t start = 0;
  for (const std::int64_t end : ends) {
    if (end < start || end > std::ssize(connectivity))
      throw InputError(
          fmt::format("{}: face {} ends at {} of {} corners", name, soup.polygons.size(), end, connectivity.size()));
    std::vector<int> corners;
    for (std::int64_t k = start; k < end; ++k) {
      const std::int64_t v = connectivity[static_cast<std::size_t>(k)];
      if (v < 0 || v >= points)
        throw InputError(
            fmt::format("{}: face {} refers to vertex {}: must be 0 to {}", name, soup.polygons.size(), v, points - 1));
      corners.push_back(static_cast<int>(base + v));
    }
    start = end;
    if (!are_strips) {
      soup.polygons.push_back(std::move(corners));
      continue;
    }
    for (std::size_t k = 2; k < corners.size(); ++k) // every other triangle of a strip runs the other way round
      soup.polygons.push_back({corners[k - 2 + k % 2], corners[k - 1 - k % 2], corners[k]});
  }
}

PolygonSoup vtk_polygons(const std::string& bytes, const std::string& name) {
  VtkReader reader(bytes, name);
  const std::string version = reader.line();
  if (!version.starts_with("# vtk DataFile Version"))
    reader.fail("does not start with '# vtk DataFile Version'; is this a legacy VTK file?");
  const bool has_offsets = version.substr(version.find_last_of(' ') + 1) >= "5.1";
  reader.line(); // title
  const std::string encoding = reader.word();
  if (encoding != "ASCII" && encoding != "BINARY")
    reader.fail(fmt::format("'{}' where ASCII or BINARY must be", encoding));
  const bool is_binary = encoding == "BINARY";
  if (reader.word() != "DATASET")
    reader.fail("DATASET is missing");
  if (const std::string kind = reader.word(); kind != "POLYDATA")
    reader.fail(fmt::format("a data set of kind {}; allowed: POLYDATA, a surface", kind));
  PolygonSoup soup;
  for (std::string word = reader.word(); !word.empty(); word = reader.word()) {
    if (word == "POINTS") {
      const std::int64_t count = reader.count();
      const std::string type = reader.word();
      const std::vector<double> numbers = reader.numbers<double>(3 * count, type, is_binary);
      for (std::size_t i = 0; i < numbers.size(); i += 3)
        soup.vertices.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    } else if (word == "POLYGONS" || word == "TRIANGLE_STRIPS") {
      read_cells(reader, word != "POLYGONS", is_binary, has_offsets, name, soup);
    } else if (word == "VERTICES" || word == "LINES") {
      PolygonSoup ignored{soup.vertices, {}};
      read_cells(reader, false, is_binary, has_offsets, name, ignored);
    } else if (word == "METADATA") {
      reader.line();
      while (!reader.line().empty()) { // it ends with a blank line
      }
    } else if (word == "POINT_DATA" || word == "CELL_DATA" || word == "FIELD") {
      break;
    } else {
      reader.fail(fmt::format("'{}' is no part of POLYDATA", word.substr(0, 24)));
    }
  }
  return soup;
}

} // namespace spherecut::topology
