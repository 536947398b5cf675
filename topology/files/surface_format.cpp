#include "topology/files/surface_format.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <optional>
#include <vector>

namespace spherecut::topology {

namespace {

using Words = std::vector<std::string_view>;

bool is_space(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

Words words_of(std::string_view line) {
  Words words;
  for (std::size_t at = 0; at < line.size();) {
    if (is_space(line[at])) {
      ++at;
      continue;
    }
    const std::size_t start = at;
    while (at < line.size() && !is_space(line[at]))
      ++at;
    words.push_back(line.substr(start, at - start));
  }
  return words;
}

/// The number that the whole word spells; nothing when it spells none.
template <typename Number>
std::optional<Number> number(std::string_view word) {
  if (word.starts_with('+'))
    word.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size())
    return std::nullopt;
  return value;
}

/// A word as it may be shown: cut short, without control characters.
std::string shown(std::string_view word) {
  std::string text(word.substr(0, 24));
  for (char& c : text)
    if (std::isprint(static_cast<unsigned char>(c)) == 0)
      c = '?';
  return text;
}

std::string lower_case(std::string_view word) {
  std::string lower(word);
  for (char& c : lower)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

/// Steps through lines, counting them, leaving out blank ones and all that follows a '#'.
class Lines {
 public:
  /// `continued`: a line that ends in a backslash goes on in the next.
  Lines(std::string_view text, const std::string& name, bool continued = false)
      : text_(text), name_(name), continued_(continued) {}

  /// The words of the next line; none at the end of the text.
  Words next() {
    while (at_ < text_.size()) {
      read_line();
      Words words = words_of(line_.substr(0, line_.find('#')));
      if (!words.empty())
        return words;
    }
    return {};
  }

  template <typename... Arguments>
  [[noreturn]] void fail(fmt::format_string<Arguments...> format, Arguments&&... arguments) const {
    throw InputError(
        fmt::format("{}: line {}: {}", name_, count_, fmt::format(format, std::forward<Arguments>(arguments)...)));
  }

  void require_finite(const Words& words, std::size_t first, const char* what) const {
    for (std::size_t i = first; i < first + 3; ++i) {
      if (i >= words.size())
        fail("{} with {} coordinates where 3 are needed; is the file cut short?", what, words.size() - first);
      const std::optional<double> value = number<double>(words[i]);
      if (!value)
        fail("'{}' is not a number", shown(words[i]));
      if (!std::isfinite(*value))
        fail("coordinate '{}' is not finite", shown(words[i]));
    }
  }

 private:
  void read_line() {
    joined_.clear();
    for (bool goes_on = true; goes_on && at_ < text_.size();) {
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      std::string_view line = text_.substr(at_, end - at_);
      at_ = end + 1;
      ++count_;
      while (!line.empty() && is_space(line.back()))
        line.remove_suffix(1);
      goes_on = continued_ && line.ends_with('\\');
      if (goes_on)
        line.remove_suffix(1);
      if (!goes_on && joined_.empty()) {
        line_ = line;
        return;
      }
      joined_ += line;
      joined_ += ' ';
    }
    line_ = joined_;
  }

  std::string_view text_;
  const std::string& name_;
  bool continued_;
  std::string joined_; // a line in parts
  std::string_view line_;
  std::size_t at_ = 0;
  int count_ = 0;
};

/// Words joined by blanks, as a line.
template <typename Iterator>
void append_line(std::string& text, Iterator first, Iterator last) {
  for (; first != last; ++first) {
    text += *first;
    text += ' ';
  }
  text.back() = '\n';
}

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

/// Text without a byte order mark and without what ends a file on some systems, in lines.
std::string plain_text(std::string text) {
  constexpr char end_of_file = 0x1A; // of CP/M and DOS
  if (text.starts_with(byte_order_mark))
    text.erase(0, byte_order_mark.size());
  while (!text.empty() && (text.back() == '\0' || text.back() == end_of_file))
    text.pop_back();
  if (text.find('\n') == std::string::npos)
    std::replace(text.begin(), text.end(), '\r', '\n');
  return text;
}

std::string checked_obj(const std::string& text, const std::string& name) {
  std::string kept;
  kept.reserve(text.size());
  Lines lines(text, name, true);
  bool any_vertex = false;
  for (Words words = lines.next(); !words.empty(); words = lines.next()) {
    const std::string_view keyword = words.front();
    if (!std::all_of(keyword.begin(), keyword.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }))
      lines.fail("'{}' is no OBJ keyword; is this an OBJ file?", shown(keyword));
    if (keyword == "v") {
      lines.require_finite(words, 1, "vertex");
      any_vertex = true;
    } else if (keyword == "f") {
      const std::size_t corners = words.size() - 1;
      if (corners < 3 || corners > most_corners)
        lines.fail("face with {} corners: must be 3 to {}; is the file cut short?", corners, most_corners);
      for (std::size_t i = 1; i < words.size(); ++i)
        if (const auto index = number<int>(words[i].substr(0, words[i].find('/'))); !index || *index == 0)
          lines.fail("'{}' is no vertex index", shown(words[i]));
    } else {
      continue;
    }
    append_line(kept, words.begin(), words.end());
  }
  if (!any_vertex)
    throw InputError(fmt::format("{}: holds no vertices; is this an OBJ file?", name));
  return kept;
}

std::string checked_off(const std::string& text, const std::string& name) {
  std::string kept = "OFF\n";
  kept.reserve(text.size());
  Lines lines(text, name);
  Words words = lines.next();
  if (words.empty() || !words.front().ends_with("OFF"))
    lines.fail("does not start with OFF; is this an OFF file?");
  if (words.size() > 1 && words[1] == "BINARY")
    lines.fail("binary OFF is not supported: save it as text");
  words.erase(words.begin());
  if (words.empty())
    words = lines.next();
  std::array<std::int64_t, 2> counts{};
  for (std::size_t i = 0; i < 2; ++i) {
    const auto count = i < words.size() ? number<std::int64_t>(words[i]) : std::nullopt;
    if (!count || *count < 0 || *count > std::ssize(text))
      lines.fail("the numbers of vertices and faces are missing or cannot be true");
    counts[i] = *count;
  }
  kept += fmt::format("{} {} 0\n", counts[0], counts[1]);
  for (std::int64_t v = 0; v < counts[0]; ++v) {
    words = lines.next();
    if (words.empty())
      lines.fail("the file is cut short: {} of {} vertices", v, counts[0]);
    lines.require_finite(words, 0, "vertex");
    append_line(kept, words.begin(), words.begin() + 3);
  }
  for (std::int64_t f = 0; f < counts[1]; ++f) {
    words = lines.next();
    if (words.empty())
      lines.fail("the file is cut short: {} of {} faces", f, counts[1]);
    const auto corners = number<int>(words.front());
    if (!corners || *corners < 3 || *corners > most_corners)
      lines.fail("face with '{}' corners: must be 3 to {}", shown(words.front()), most_corners);
    if (std::ssize(words) <= *corners)
      lines.fail("face with {} indices where {} are needed; is the file cut short?", words.size() - 1, *corners);
    for (int i = 1; i <= *corners; ++i)
      if (const auto index = number<std::int64_t>(words[i]); !index || *index < 0 || *index >= counts[0])
        lines.fail("index '{}': must be 0 to {}", shown(words[i]), counts[0] - 1);
    append_line(kept, words.begin(), words.begin() + 1 + *corners);
  }
  return kept;
}

std::string checked_text_stl(const std::string& text, const std::string& name) {
  std::string kept;
  kept.reserve(text.size());
  Lines lines(text, name);
  bool open = false;
  for (Words words = lines.next(); !words.empty(); words = lines.next()) {
    const std::string keyword = lower_case(words.front());
    if (keyword == "vertex") {
      lines.require_finite(words, 1, "vertex");
      kept += "vertex ";
      append_line(kept, words.begin() + 1, words.begin() + 4);
      continue;
    }
    if (keyword == "solid")
      open = true;
    else if (keyword == "endsolid")
      open = false;
    else if (keyword != "facet" && keyword != "outer" && keyword != "endloop" && keyword != "endfacet")
      lines.fail("'{}' is no STL keyword; is the file cut short?", shown(words.front()));
    kept += keyword == "facet" ? "facet normal 0 0 0" : keyword == "outer" ? "outer loop" : keyword;
    kept += '\n';
  }
  if (open)
    lines.fail("the file is cut short: 'endsolid' is missing");
  return kept;
}

void check_binary_stl(const std::string& text, const std::string& name) {
  constexpr std::size_t header = 84, facet_bytes = 50;
  std::uint32_t facets = 0;
  if (text.size() >= header)
    std::memcpy(&facets, text.data() + 80, sizeof(facets));
  if (text.size() < header || text.size() < header + facet_bytes * facets)
    throw InputError(fmt::format("{}: neither text STL nor whole binary STL: {} bytes, and {} facets need {}; is the "
                                 "file cut short, or not an STL file?",
                                 name, text.size(), facets, header + facet_bytes * facets));
  for (std::size_t f = 0; f < facets; ++f) {
    std::array<float, 12> numbers; // normal and three corners
    std::memcpy(numbers.data(), text.data() + header + facet_bytes * f, sizeof(numbers));
    if (!std::all_of(numbers.begin() + 3, numbers.end(), [](float x) { return std::isfinite(x); }))
      throw InputError(fmt::format("{}: facet {} has a coordinate that is not finite", name, f));
  }
}

std::string checked_stl(std::string text, const std::string& name) {
  constexpr std::size_t header = 84, facet_bytes = 50;
  std::uint32_t facets = 0;
  if (text.size() >= header)
    std::memcpy(&facets, text.data() + 80, sizeof(facets));
  std::string_view start(text);
  if (start.starts_with(byte_order_mark))
    start.remove_prefix(byte_order_mark.size());
  start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n"), start.size()));
  // Some programs start binary files with "solid" too: the size tells.
  if (lower_case(start.substr(0, 5)) == "solid" && text.size() != header + facet_bytes * facets)
    return checked_text_stl(plain_text(std::move(text)), name);
  check_binary_stl(text, name);
  return text;
}

/// Numbers of a PLY body in any of its encodings.
class PlyNumbers {
 public:
  enum class Encoding { text, little_endian, big_endian };

  PlyNumbers(std::string_view body, Encoding encoding) : body_(body), encoding_(encoding) {}

  /// The next number of the named PLY type; nothing when the body ends or the type or number is unknown.
  std::optional<double> next(const std::string& type) {
    if (encoding_ == Encoding::text) {
      while (at_ < body_.size() && is_space(body_[at_]))
        ++at_;
      const std::size_t start = at_;
      while (at_ < body_.size() && !is_space(body_[at_]))
        ++at_;
      return number<double>(body_.substr(start, at_ - start));
    }
    if (type == "char" || type == "int8")
      return take<std::int8_t>();
    if (type == "uchar" || type == "uint8")
      return take<std::uint8_t>();
    if (type == "short" || type == "int16")
      return take<std::int16_t>();
    if (type == "ushort" || type == "uint16")
      return take<std::uint16_t>();
    if (type == "int" || type == "int32")
      return take<std::int32_t>();
    if (type == "uint" || type == "uint32")
      return take<std::uint32_t>();
    if (type == "float" || type == "float32")
      return take<float>();
    if (type == "double" || type == "float64")
      return take<double>();
    return std::nullopt;
  }

 private:
  template <typename Type>
  std::optional<double> take() {
    if (body_.size() - at_ < sizeof(Type))
      return std::nullopt;
    std::array<char, sizeof(Type)> bytes;
    std::memcpy(bytes.data(), body_.data() + at_, sizeof(Type));
    at_ += sizeof(Type);
    if ((encoding_ == Encoding::big_endian) != (std::endian::native == std::endian::big))
      std::reverse(bytes.begin(), bytes.end());
    return static_cast<double>(std::bit_cast<Type>(bytes));
  }

  std::string_view body_;
  Encoding encoding_;
  std::size_t at_ = 0;
};

struct PlyProperty {
  std::string count_type; // empty unless a list
  std::string type;
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyNumbers::Encoding encoding = PlyNumbers::Encoding::text;
  std::vector<PlyElement> elements;
  std::size_t body = 0; // offset of the first byte after the header
};

PlyHeader ply_header(const std::string& text, const std::string& name) {
  const std::size_t mark = text.find("end_header");
  const std::size_t end = mark == std::string::npos ? mark : text.find('\n', mark);
  if (!text.starts_with("ply") || end == std::string::npos)
    throw InputError(fmt::format("{}: has no PLY header; is this a whole PLY file?", name));
  PlyHeader header;
  header.body = end + 1;
  Lines lines(std::string_view(text).substr(0, mark), name);
  for (Words words = lines.next(); !words.empty(); words = lines.next()) {
    if (words.front() == "format" && words.size() >= 2) {
      if (words[1] == "binary_little_endian")
        header.encoding = PlyNumbers::Encoding::little_endian;
      else if (words[1] == "binary_big_endian")
        header.encoding = PlyNumbers::Encoding::big_endian;
      else if (words[1] != "ascii")
        lines.fail("unknown PLY format '{}'", shown(words[1]));
    } else if (words.front() == "element") {
      const auto count = words.size() >= 3 ? number<std::int64_t>(words[2]) : std::nullopt;
      if (!count || *count < 0 || *count > std::ssize(text))
        lines.fail("the number of elements is missing or cannot be true");
      header.elements.push_back({std::string(words[1]), *count, {}});
    } else if (words.front() == "property") {
      const bool list = words.size() >= 2 && words[1] == "list";
      if (header.elements.empty() || words.size() < (list ? 5U : 3U))
        lines.fail("broken PLY property");
      header.elements.back().properties.push_back(list ? PlyProperty{std::string(words[2]), std::string(words[3])}
                                                       : PlyProperty{{}, std::string(words[1])});
    }
  }
  return header;
}

void check_ply(const std::string& text, const std::string& name) {
  const PlyHeader header = ply_header(text, name);
  PlyNumbers numbers(std::string_view(text).substr(header.body), header.encoding);
  for (const PlyElement& element : header.elements)
    for (std::int64_t item = 0; item < element.count; ++item) {
      const auto next = [&](const std::string& type) {
        const std::optional<double> value = numbers.next(type);
        if (!value)
          throw InputError(fmt::format("{}: ends or is unreadable within {} {} of {}; is the file cut short?", name,
                                       element.name, item, element.count));
        return *value;
      };
      for (const PlyProperty& property : element.properties) {
        if (property.count_type.empty()) {
          if (!std::isfinite(next(property.type)) && element.name == "vertex")
            throw InputError(fmt::format("{}: vertex {} has a coordinate or value that is not finite", name, item));
          continue;
        }
        const double count = next(property.count_type);
        if (!(count >= 0 && count <= most_corners))
          throw InputError(fmt::format("{}: {} {} has a list of {} entries: at most {}", name, element.name, item,
                                       count, most_corners));
        for (int i = 0; i < static_cast<int>(count); ++i)
          next(property.type);
      }
    }
}

} // namespace

std::string checked_text(SurfaceFormat format, std::string text, const std::string& name) {
  switch (format) {
  case SurfaceFormat::obj:
    return checked_obj(plain_text(std::move(text)), name);
  case SurfaceFormat::ply:
    if (text.starts_with(byte_order_mark))
      text.erase(0, byte_order_mark.size());
    check_ply(text, name);
    break;
  case SurfaceFormat::stl:
    return checked_stl(std::move(text), name);
  case SurfaceFormat::off:
    return checked_off(plain_text(std::move(text)), name);
  }
  return text;
}

} // namespace spherecut::topology
