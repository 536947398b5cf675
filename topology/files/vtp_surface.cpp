// The XML of a .vtp file is flat where polygons are concerned: tags and the text between them are looked through one
// after the other, so that neither depth nor the raw bytes of appended data matter.
#include "topology/base/errors.hpp"
#include "topology/base/inflate.hpp"
#include "topology/files/vtk_cells.hpp"
#include "topology/files/vtk_surface.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <string_view>

namespace spherecut::topology {

namespace {

struct XmlTag {
  std::string name; // "/Points" where it ends
  std::map<std::string, std::string> attributes;
  std::size_t after = 0; // first byte behind it
  [[nodiscard]] std::string attribute(const std::string& key, const std::string& fallback = "") const {
    const auto found = attributes.find(key);
    return found == attributes.end() ? fallback : found->second;
  }
};

constexpr std::string_view xml_blanks = " \t\r\n";

/// The next tag from `at` on; nothing at the end. Comments and declarations are passed over.
std::optional<XmlTag> next_tag(std::string_view text, std::size_t at, const std::string& name) {
  while (true) {
    const std::size_t open = text.find('<', at);
    if (open == std::string_view::npos)
      return std::nullopt;
    const bool is_comment = text.substr(open, 4) == "<!--";
    const std::size_t close = text.find(is_comment ? "-->" : ">", open);
    if (close == std::string_view::npos)
      throw InputError(fmt::format("{}: byte {}: a tag without end; is the file cut short?", name, open));
    at = close + (is_comment ? 3 : 1);
    if (is_comment || text[open + 1] == '?' || text[open + 1] == '!')
      continue;
    XmlTag tag;
    tag.after = at;
    const std::string_view inner = text.substr(open + 1, close - open - 1);
    std::size_t end = std::min(inner.find_first_of(xml_blanks), inner.size());
    tag.name = std::string(inner.substr(0, end));
    while (true) {
      const std::size_t equals = inner.find('=', end);
      const std::size_t quote = equals == std::string_view::npos ? equals : inner.find_first_of("\"'", equals);
      const std::size_t last = quote == std::string_view::npos ? quote : inner.find(inner[quote], quote + 1);
      if (last == std::string_view::npos)
        break;
      std::string_view key = inner.substr(end, equals - end);
      key.remove_prefix(std::min(key.find_first_not_of(xml_blanks), key.size()));
      key = key.substr(0, key.find_first_of(xml_blanks));
      tag.attributes[std::string(key)] = std::string(inner.substr(quote + 1, last - quote - 1));
      end = last + 1;
    }
    return tag;
  }
}

/// Bytes that base64 spells, up to the first other character; parts that were each padded follow one another.
std::string from_base64(std::string_view text) {
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3);
  std::uint32_t group = 0;
  int digits = 0, padded = 0;
  for (const char c : text) {
    std::uint32_t digit = 0;
    if (c >= 'A' && c <= 'Z')
      digit = static_cast<std::uint32_t>(c - 'A');
    else if (c >= 'a' && c <= 'z')
      digit = static_cast<std::uint32_t>(c - 'a') + 26;
    else if (c >= '0' && c <= '9')
      digit = static_cast<std::uint32_t>(c - '0') + 52;
    else if (c == '+')
      digit = 62;
    else if (c == '/')
      digit = 63;
    else if (c == '=')
      ++padded;
    else if (xml_blanks.find(c) != std::string_view::npos)
      continue;
    else
      break;
    group = group << 6U | digit;
    if (++digits < 4)
      continue;
    for (int k = 0; k < 3 - padded; ++k)
      bytes += static_cast<char>(group >> (16U - 8U * static_cast<unsigned>(k)) & 0xFFU);
    group = 0;
    digits = padded = 0;
  }
  return bytes;
}

class VtpReader {
 public:
  VtpReader(const std::string& bytes, const std::string& name) : text_(bytes), name_(name) {}

  PolygonSoup read() {
    const std::size_t appended = text_.find("<AppendedData");
    xml_ = text_.substr(0, appended);
    if (appended != std::string_view::npos) {
      const XmlTag tag = *next_tag(text_, appended, name_);
      is_raw_ = tag.attribute("encoding") == "raw";
      const std::size_t mark = text_.find('_', tag.after);
      appended_ = mark == std::string_view::npos ? std::string_view{} : text_.substr(mark + 1);
    }
    std::string part;
    bool is_poly_data = false;
    for (auto tag = next_tag(xml_, 0, name_); tag; tag = next_tag(xml_, tag->after, name_)) {
      if (tag->name == "VTKFile") {
        is_poly_data = tag->attribute("type") == "PolyData";
        read_file_tag(*tag);
      } else if (tag->name == "Piece") {
        piece_.clear();
      } else if (tag->name == "Points" || tag->name == "Polys" || tag->name == "Strips") {
        part = tag->name;
      } else if (tag->name == "/Piece") {
        add_piece();
      } else if (tag->name.starts_with('/') && tag->name.substr(1) == part) {
        part.clear();
      } else if (tag->name == "DataArray" && !part.empty()) {
        piece_[part == "Points" ? part : part + "/" + tag->attribute("Name")] = array(*tag);
      }
    }
    if (!is_poly_data)
      throw InputError(fmt::format("{}: is no VTK file of type PolyData; is this a .vtp file?", name_));
    return std::move(soup_);
  }

 private:
  void read_file_tag(const XmlTag& tag) {
    big_endian_ = tag.attribute("byte_order") == "BigEndian";
    long_headers_ = tag.attribute("header_type", "UInt32") == "UInt64";
    const std::string compressor = tag.attribute("compressor");
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
      throw InputError(fmt::format("{}: its data are packed by {}; allowed: vtkZLibDataCompressor or none", name_,
                                   compressor.substr(0, 40)));
    is_packed_ = !compressor.empty();
  }

  std::vector<double> array(const XmlTag& tag) const {
    const std::string format = tag.attribute("format", "ascii"), type = tag.attribute("type");
    const std::string_view inner = xml_.substr(tag.after, xml_.find('<', tag.after) - tag.after);
    if (format == "ascii")
      return from_text(inner);
    if (format == "binary")
      return from_bytes(unpacked(from_base64(inner)), type);
    const std::string offset = tag.attribute("offset");
    std::size_t at = 0;
    const auto [end, error] = std::from_chars(offset.data(), offset.data() + offset.size(), at);
    if (format != "appended" || error != std::errc() || end != offset.data() + offset.size() || at > appended_.size())
      throw InputError(fmt::format("{}: an array of format '{}' at offset '{}' of {} bytes", name_,
                                   format.substr(0, 24), offset.substr(0, 24), appended_.size()));
    const std::string_view rest = appended_.substr(at);
    return from_bytes(is_raw_ ? unpacked(rest) : unpacked(from_base64(rest)), type);
  }

  [[nodiscard]] std::vector<double> from_text(std::string_view text) const {
    std::vector<double> numbers;
    for (std::size_t at = text.find_first_not_of(xml_blanks); at < text.size();) {
      double value = 0;
      const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), value);
      if (error != std::errc())
        throw InputError(fmt::format("{}: '{}' is no number", name_, text.substr(at, 12)));
      numbers.push_back(value);
      at = text.find_first_not_of(xml_blanks, static_cast<std::size_t>(end - text.data()));
    }
    return numbers;
  }

  template <typename Value>
  [[nodiscard]] Value value_at(std::string_view bytes, std::size_t at) const {
    if (at > bytes.size() || bytes.size() - at < sizeof(Value))
      throw InputError(fmt::format("{}: its data end early; is the file cut short?", name_));
    std::array<char, sizeof(Value)> raw;
    std::memcpy(raw.data(), bytes.data() + at, sizeof(Value));
    if (big_endian_ != (std::endian::native == std::endian::big))
      std::reverse(raw.begin(), raw.end());
    return std::bit_cast<Value>(raw);
  }

  /// Number k of a header before data.
  [[nodiscard]] std::uint64_t header(std::string_view bytes, std::size_t k) const {
    return long_headers_ ? value_at<std::uint64_t>(bytes, 8 * k) : value_at<std::uint32_t>(bytes, 4 * k);
  }

  /// The bytes of an array behind its header: their number, or, packed, those of blocks.
  [[nodiscard]] std::string unpacked(std::string_view bytes) const {
    const std::size_t width = long_headers_ ? 8 : 4;
    if (!is_packed_) {
      const std::uint64_t size = header(bytes, 0);
      if (size > bytes.size() - width)
        throw InputError(fmt::format("{}: an array of {} bytes where {} are left; is the file cut short?", name_, size,
                                     bytes.size() - width));
      return std::string(bytes.substr(width, size));
    }
    const std::uint64_t blocks = header(bytes, 0), size = header(bytes, 1), last = header(bytes, 2);
    constexpr std::uint64_t largest = 2'000'000'000;
    if (blocks > bytes.size() || size > largest || last > size || blocks * size > largest)
      throw InputError(fmt::format("{}: an array in {} blocks of {} bytes cannot be true", name_, blocks, size));
    std::string out;
    std::size_t at = (3 + blocks) * width;
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const std::uint64_t packed = header(bytes, 3 + b);
      if (at > bytes.size() || packed > bytes.size() - at)
        throw InputError(fmt::format("{}: its data end early; is the file cut short?", name_));
      out += inflated(bytes.substr(at, packed), b + 1 == blocks && last > 0 ? last : size, name_);
      at += packed;
    }
    return out;
  }

  template <typename Value>
  [[nodiscard]] std::vector<double> values(std::string_view bytes) const {
    std::vector<double> numbers;
    numbers.reserve(bytes.size() / sizeof(Value));
    for (std::size_t at = 0; at + sizeof(Value) <= bytes.size(); at += sizeof(Value))
      numbers.push_back(static_cast<double>(value_at<Value>(bytes, at)));
    return numbers;
  }

  [[nodiscard]] std::vector<double> from_bytes(const std::string& bytes, const std::string& type) const {
    if (type == "Float32")
      return values<float>(bytes);
    if (type == "Float64")
      return values<double>(bytes);
    if (type == "Int32")
      return values<std::int32_t>(bytes);
    if (type == "UInt32")
      return values<std::uint32_t>(bytes);
    if (type == "Int64")
      return values<std::int64_t>(bytes);
    if (type == "UInt64")
      return values<std::uint64_t>(bytes);
    throw InputError(fmt::format("{}: an array of type '{}'; allowed: Float32, Float64, (U)Int32, (U)Int64", name_,
                                 type.substr(0, 24)));
  }

  void add_piece() {
    const std::vector<double>& points = piece_["Points"];
    const std::int64_t base = std::ssize(soup_.vertices), count = std::ssize(points) / 3;
    for (std::size_t i = 0; i + 2 < points.size(); i += 3)
      soup_.vertices.emplace_back(points[i], points[i + 1], points[i + 2]);
    const auto whole = [&](const std::string& key) {
      std::vector<std::int64_t> numbers;
      for (const double value : piece_[key]) {
        if (!(std::abs(value) < 1e15))
          throw InputError(fmt::format("{}: {} holds {}", name_, key, value));
        numbers.push_back(static_cast<std::int64_t>(value));
      }
      return numbers;
    };
    for (const std::string part : {"Polys", "Strips"})
      add_vtk_cells(whole(part + "/connectivity"), whole(part + "/offsets"), part == "Strips", base, count, name_,
                    soup_);
  }

  std::string_view text_;
  std::string_view xml_, appended_;
  std::string name_;
  bool is_raw_ = false, big_endian_ = false, long_headers_ = false, is_packed_ = false;
  std::map<std::string, std::vector<double>> piece_;
  PolygonSoup soup_;
};

} // namespace

PolygonSoup vtp_polygons(const std::string& bytes, const std::string& name) {
  return VtpReader(bytes, name).read();
}

} // namespace spherecut::topology
