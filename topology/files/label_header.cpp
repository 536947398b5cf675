#include "topology/files/label_header.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <string_view>
#include <vector>

namespace spherecut::topology {

namespace {

constexpr double millimetre = 1e-3; // m

std::string lowered(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r\n";
  const std::size_t first = text.find_first_not_of(blanks);
  return first == std::string_view::npos ? std::string_view{}
                                         : text.substr(first, text.find_last_not_of(blanks) + 1 - first);
}

/// What a message shows of a header's value.
std::string shown_value(std::string_view text) {
  std::string part(text.substr(0, 40));
  for (char& c : part)
    if (std::isprint(static_cast<unsigned char>(c)) == 0)
      c = '?';
  return part;
}

/// All numbers of a text between blanks, brackets and commas; nothing when something else is there.
std::optional<std::vector<double>> numbers_of(std::string_view text) {
  std::vector<double> numbers;
  for (std::size_t at = 0; at < text.size();) {
    if (std::string_view(" \t\r()[],").find(text[at]) != std::string_view::npos) {
      ++at;
      continue;
    }
    double value = 0;
    const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), value);
    if (error != std::errc())
      return std::nullopt;
    numbers.push_back(value);
    at = static_cast<std::size_t>(end - text.data());
  }
  return numbers;
}

/// Keys and values of a text header.
class HeaderFields {
 public:
  explicit HeaderFields(const std::string& name) : name_(name) {}

  void add(std::string_view key, std::string_view value) { fields_[lowered(trimmed(key))] = trimmed(value); }
  [[nodiscard]] bool has(const std::string& key) const { return fields_.contains(key); }
  [[nodiscard]] std::string text(const std::string& key) const {
    const auto found = fields_.find(key);
    if (found == fields_.end())
      fail(fmt::format("its header has no '{}'", key));
    return found->second;
  }
  [[nodiscard]] std::string text_or(const std::string& key, const std::string& fallback) const {
    return has(key) ? text(key) : fallback;
  }
  [[nodiscard]] std::vector<double> numbers(const std::string& key, std::size_t count) const {
    const auto found = numbers_of(text(key));
    if (!found || found->size() != count ||
        !std::all_of(found->begin(), found->end(), [](double x) { return std::isfinite(x); }))
      fail(fmt::format("'{}: {}' in its header: allowed: {} finite numbers", key, shown_value(text(key)), count));
    return *found;
  }
  [[noreturn]] void fail(const std::string& what) const { throw InputError(fmt::format("{}: {}", name_, what)); }

 private:
  std::string name_;
  std::map<std::string, std::string> fields_;
};

void set_size(const std::vector<double>& sizes, LabelHeader& header) {
  for (int d = 0; d < 3; ++d) // out of range is told by who asks for the memory
    header.size[d] = sizes[d] >= 0 && sizes[d] < 1e9 ? static_cast<std::int64_t>(sizes[d]) : 0;
}

std::optional<double> unit_named(const std::string& text) {
  if (text.find("mm") != std::string::npos || text.find("millimet") != std::string::npos)
    return millimetre;
  if (text.find("cm") != std::string::npos)
    return 1e-2;
  if (text.find("um") != std::string::npos || text.find("micromet") != std::string::npos)
    return 1e-6;
  if (text.find("\"m\"") != std::string::npos || text.find("met") != std::string::npos)
    return 1.0;
  return std::nullopt;
}

VoxelType nrrd_type(const HeaderFields& fields) {
  const std::string type = lowered(fields.text("type"));
  static const std::map<std::string, VoxelType> known = {{"signed char", VoxelType::int8},
                                                         {"int8", VoxelType::int8},
                                                         {"int8_t", VoxelType::int8},
                                                         {"uchar", VoxelType::uint8},
                                                         {"unsigned char", VoxelType::uint8},
                                                         {"uint8", VoxelType::uint8},
                                                         {"uint8_t", VoxelType::uint8},
                                                         {"short", VoxelType::int16},
                                                         {"short int", VoxelType::int16},
                                                         {"signed short", VoxelType::int16},
                                                         {"signed short int", VoxelType::int16},
                                                         {"int16", VoxelType::int16},
                                                         {"int16_t", VoxelType::int16},
                                                         {"ushort", VoxelType::uint16},
                                                         {"unsigned short", VoxelType::uint16},
                                                         {"unsigned short int", VoxelType::uint16},
                                                         {"uint16", VoxelType::uint16},
                                                         {"uint16_t", VoxelType::uint16},
                                                         {"int", VoxelType::int32},
                                                         {"signed int", VoxelType::int32},
                                                         {"int32", VoxelType::int32},
                                                         {"int32_t", VoxelType::int32},
                                                         {"uint", VoxelType::uint32},
                                                         {"unsigned int", VoxelType::uint32},
                                                         {"uint32", VoxelType::uint32},
                                                         {"uint32_t", VoxelType::uint32},
                                                         {"longlong", VoxelType::int64},
                                                         {"long long", VoxelType::int64},
                                                         {"int64", VoxelType::int64},
                                                         {"int64_t", VoxelType::int64},
                                                         {"ulonglong", VoxelType::uint64},
                                                         {"unsigned long long", VoxelType::uint64},
                                                         {"uint64", VoxelType::uint64},
                                                         {"uint64_t", VoxelType::uint64},
                                                         {"float", VoxelType::float32},
                                                         {"double", VoxelType::float64}};
  const auto found = known.find(type);
  if (found == known.end())
    fields.fail(fmt::format("voxels of type '{}'; allowed: whole numbers, float, double", shown_value(type)));
  return found->second;
}

VoxelType meta_type(const HeaderFields& fields) {
  const std::string type = fields.text("elementtype");
  static const std::map<std::string, VoxelType> known = {
      {"MET_CHAR", VoxelType::int8},       {"MET_UCHAR", VoxelType::uint8},       {"MET_SHORT", VoxelType::int16},
      {"MET_USHORT", VoxelType::uint16},   {"MET_INT", VoxelType::int32},         {"MET_UINT", VoxelType::uint32},
      {"MET_LONG_LONG", VoxelType::int64}, {"MET_ULONG_LONG", VoxelType::uint64}, {"MET_FLOAT", VoxelType::float32},
      {"MET_DOUBLE", VoxelType::float64}};
  const auto found = known.find(type);
  if (found == known.end())
    fields.fail(fmt::format("voxels of type '{}'; allowed: whole numbers, float, double", shown_value(type)));
  return found->second;
}

/// Bytes of a NIfTI header, in its byte order.
class NiftiBytes {
 public:
  NiftiBytes(const std::string& bytes, bool swapped) : bytes_(bytes), swapped_(swapped) {}
  template <typename Value>
  [[nodiscard]] Value at(std::size_t offset) const {
    std::array<char, sizeof(Value)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset, sizeof(Value));
    if (swapped_)
      std::reverse(raw.begin(), raw.end());
    return std::bit_cast<Value>(raw);
  }

 private:
  const std::string& bytes_;
  bool swapped_;
};

// Offsets in the header of NIfTI-1 [nifti1.h].
constexpr std::size_t nifti_bytes = 348, nifti_dim = 40, nifti_datatype = 70, nifti_pixdim = 76, nifti_vox_offset = 108,
                      nifti_slope = 112, nifti_intercept = 116, nifti_units = 123, nifti_qform_code = 252,
                      nifti_sform_code = 254, nifti_quaternion = 256, nifti_offset = 268, nifti_rows = 280,
                      nifti_magic = 344;

void nifti_frame(const NiftiBytes& at, LabelHeader& header) {
  const auto number = [&](std::size_t offset, int k) {
    return static_cast<double>(at.at<float>(offset + 4 * static_cast<std::size_t>(k)));
  };
  const Vector3 spacing(number(nifti_pixdim, 1), number(nifti_pixdim, 2), number(nifti_pixdim, 3));
  if (at.at<std::int16_t>(nifti_sform_code) > 0) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        header.axes(row, column) = number(nifti_rows, 4 * row + column);
      header.origin[row] = number(nifti_rows, 4 * row + 3);
    }
    return;
  }
  header.axes = spacing.cwiseAbs().asDiagonal();
  if (at.at<std::int16_t>(nifti_qform_code) <= 0)
    return;
  const double b = number(nifti_quaternion, 0), c = number(nifti_quaternion, 1), d = number(nifti_quaternion, 2);
  const double a = std::sqrt(std::max(0.0, 1 - b * b - c * c - d * d));
  Vector3 steps = spacing.cwiseAbs();
  if (number(nifti_pixdim, 0) < 0)
    steps.z() = -steps.z();
  header.axes = Eigen::Quaterniond(a, b, c, d).normalized().toRotationMatrix() * steps.asDiagonal();
  header.origin = Vector3(number(nifti_offset, 0), number(nifti_offset, 1), number(nifti_offset, 2));
}

} // namespace

LabelHeader nrrd_header(const std::string& bytes, const std::string& name) {
  HeaderFields fields(name);
  if (!bytes.starts_with("NRRD"))
    fields.fail("does not start with NRRD; is this an NRRD file?");
  LabelHeader header;
  std::size_t at = 0;
  for (bool first = true;; first = false) {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string::npos)
      fields.fail("its header has no end; is the file cut short?");
    const std::string_view line = trimmed(std::string_view(bytes).substr(at, end - at));
    at = end + 1;
    if (line.empty())
      break;
    const std::size_t colon = line.find(':');
    if (!first && line.front() != '#' && colon != std::string_view::npos && line.substr(colon, 2) != ":=")
      fields.add(line.substr(0, colon), line.substr(colon + 1));
  }
  if (fields.has("data file") || fields.has("datafile"))
    fields.fail("its data are in another file; allowed: header and data in one (.nrrd)");
  if (fields.numbers("dimension", 1)[0] != 3)
    fields.fail(fmt::format("has {} dimensions; allowed: three, of single labels", fields.text("dimension")));
  set_size(fields.numbers("sizes", 3), header);
  header.type = nrrd_type(fields);
  header.big_endian = lowered(fields.text_or("endian", "little")) == "big";
  const std::string encoding = lowered(fields.text("encoding"));
  header.packed = encoding == "gzip" || encoding == "gz";
  header.as_text = encoding == "text" || encoding == "txt" || encoding == "ascii";
  if (!header.packed && !header.as_text && encoding != "raw")
    fields.fail(fmt::format("encoding '{}'; allowed: raw, gzip, text", shown_value(encoding)));
  for (const char* skip : {"line skip", "lineskip", "byte skip", "byteskip"})
    if (fields.has(skip) && fields.numbers(skip, 1)[0] != 0)
      fields.fail(fmt::format("'{}: {}' in its header; allowed: 0", skip, shown_value(fields.text(skip))));
  if (fields.has("space directions")) {
    const std::vector<double> directions = fields.numbers("space directions", 9);
    for (int k = 0; k < 9; ++k)
      header.axes(k % 3, k / 3) = directions[k];
  } else if (fields.has("spacings")) {
    const std::vector<double> spacings = fields.numbers("spacings", 3);
    header.axes = Vector3(spacings[0], spacings[1], spacings[2]).asDiagonal();
  }
  if (fields.has("space origin")) {
    const std::vector<double> origin = fields.numbers("space origin", 3);
    header.origin = {origin[0], origin[1], origin[2]};
  }
  header.unit = unit_named(lowered(fields.text_or("space units", fields.text_or("units", ""))));
  header.data = at;
  return header;
}

LabelHeader nifti_header(const std::string& bytes, const std::string& name) {
  const auto fail = [&](const std::string& what) { throw InputError(fmt::format("{}: {}", name, what)); };
  if (bytes.size() < nifti_bytes)
    fail(fmt::format("{} bytes are no NIfTI header of {}; is the file cut short?", bytes.size(), nifti_bytes));
  LabelHeader header;
  const bool native_little = std::endian::native == std::endian::little;
  const bool swapped = NiftiBytes(bytes, true).at<std::int32_t>(0) == static_cast<std::int32_t>(nifti_bytes);
  const NiftiBytes at(bytes, swapped);
  if (at.at<std::int32_t>(0) != static_cast<std::int32_t>(nifti_bytes) || bytes.substr(nifti_magic, 3) != "n+1")
    fail("is no NIfTI-1 file of header and data in one; allowed: .nii and .nii.gz of that kind");
  header.big_endian = swapped == native_little;
  const int dimensions = at.at<std::int16_t>(nifti_dim);
  if (dimensions < 1 || dimensions > 7)
    fail(fmt::format("has {} dimensions; allowed: three", dimensions));
  for (int d = 0; d < 7; ++d) {
    const int size = d < dimensions ? at.at<std::int16_t>(nifti_dim + 2 + 2 * static_cast<std::size_t>(d)) : 1;
    if (d < 3)
      header.size[d] = size;
    else if (size > 1)
      fail(fmt::format("has {} volumes; allowed: one", size));
  }
  static const std::map<int, VoxelType> known = {
      {2, VoxelType::uint8},    {4, VoxelType::int16},    {8, VoxelType::int32},    {16, VoxelType::float32},
      {64, VoxelType::float64}, {256, VoxelType::int8},   {512, VoxelType::uint16}, {768, VoxelType::uint32},
      {1024, VoxelType::int64}, {1280, VoxelType::uint64}};
  const auto type = known.find(at.at<std::int16_t>(nifti_datatype));
  if (type == known.end())
    fail(fmt::format("voxels of NIfTI type {}; allowed: whole numbers, float, double",
                     at.at<std::int16_t>(nifti_datatype)));
  header.type = type->second;
  const double slope = at.at<float>(nifti_slope), intercept = at.at<float>(nifti_intercept);
  if (std::isfinite(slope) && slope != 0 && std::isfinite(intercept)) {
    header.slope = slope;
    header.intercept = intercept;
  }
  const double offset = at.at<float>(nifti_vox_offset);
  if (!(offset >= static_cast<double>(nifti_bytes) && offset <= static_cast<double>(bytes.size())))
    fail(fmt::format("its data start at byte {}; allowed: {} to the end of the file", offset, nifti_bytes));
  header.data = static_cast<std::size_t>(offset);
  nifti_frame(at, header);
  switch (static_cast<unsigned char>(bytes[nifti_units]) & 7U) {
  case 1:
    header.unit = 1.0;
    break;
  case 2:
    header.unit = millimetre;
    break;
  case 3:
    header.unit = 1e-6;
    break;
  default:
    break;
  }
  return header;
}

LabelHeader meta_header(const std::string& bytes, const std::string& name) {
  HeaderFields fields(name);
  LabelHeader header;
  std::size_t at = 0;
  while (!fields.has("elementdatafile")) {
    const std::size_t end = bytes.find('\n', at);
    const std::string_view line = std::string_view(bytes).substr(at, std::min(end, bytes.size()) - at);
    const std::size_t equals = line.find('=');
    if (end == std::string::npos || equals == std::string_view::npos)
      fields.fail("its header has a line without '=', or no ElementDataFile; is this a whole MetaImage file?");
    fields.add(line.substr(0, equals), line.substr(equals + 1));
    at = end + 1;
  }
  if (fields.text("elementdatafile") != "LOCAL")
    fields.fail(fmt::format("its data are in '{}'; allowed: header and data in one file (.mha)",
                            shown_value(fields.text("elementdatafile"))));
  if (fields.numbers("ndims", 1)[0] != 3 ||
      (fields.has("elementnumberofchannels") && fields.numbers("elementnumberofchannels", 1)[0] != 1))
    fields.fail("is not of three dimensions and single labels; nothing else is allowed");
  set_size(fields.numbers("dimsize", 3), header);
  header.type = meta_type(fields);
  const auto is_true = [&](const char* key) { return lowered(fields.text_or(key, "false")) == "true"; };
  header.packed = is_true("compresseddata");
  header.as_text = fields.has("binarydata") && !is_true("binarydata");
  header.big_endian = is_true("binarydatabyteordermsb") || is_true("elementbyteordermsb");
  Vector3 spacing(1, 1, 1);
  for (const char* key : {"elementsize", "elementspacing"})
    if (fields.has(key)) {
      const std::vector<double> steps = fields.numbers(key, 3);
      spacing = {steps[0], steps[1], steps[2]};
    }
  Matrix3 directions = Matrix3::Identity();
  for (const char* key : {"orientation", "rotation", "transformmatrix"})
    if (fields.has(key)) {
      const std::vector<double> columns = fields.numbers(key, 9);
      for (int k = 0; k < 9; ++k)
        directions(k % 3, k / 3) = columns[k];
    }
  header.axes = directions * spacing.asDiagonal();
  for (const char* key : {"origin", "position", "offset"})
    if (fields.has(key)) {
      const std::vector<double> origin = fields.numbers(key, 3);
      header.origin = {origin[0], origin[1], origin[2]};
    }
  header.unit = millimetre; // by definition
  header.data = at;
  return header;
}

} // namespace spherecut::topology
