#include "topology/files/label_volume.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/inflate.hpp"
#include "topology/files/label_header.hpp"
#include "topology/files/surface_format.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace spherecut::topology {

namespace {

constexpr double most_voxels = 4e8;
constexpr double unit_of_silence = 1e-3; // m, where a header names none

enum class LabelFormat : std::uint8_t { nrrd, nifti, packed_nifti, meta };

std::optional<LabelFormat> label_format(const std::filesystem::path& file) {
  std::string name = file.filename().string();
  for (char& c : name)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (name.ends_with(".nrrd"))
    return LabelFormat::nrrd;
  if (name.ends_with(".nii"))
    return LabelFormat::nifti;
  if (name.ends_with(".nii.gz"))
    return LabelFormat::packed_nifti;
  if (name.ends_with(".mha"))
    return LabelFormat::meta;
  return std::nullopt;
}

std::size_t bytes_of(VoxelType type) {
  switch (type) {
  case VoxelType::int8:
  case VoxelType::uint8:
    return 1;
  case VoxelType::int16:
  case VoxelType::uint16:
    return 2;
  case VoxelType::int32:
  case VoxelType::uint32:
  case VoxelType::float32:
    return 4;
  case VoxelType::int64:
  case VoxelType::uint64:
  case VoxelType::float64:
    break;
  }
  return 8;
}

/// Takes values one by one, each a whole number or an error.
class LabelTaker {
 public:
  LabelTaker(const LabelHeader& header, LabelVolume& volume, const std::string& name)
      : header_(header), volume_(volume), name_(name) {}

  void take(double raw) {
    const double value = header_.slope * raw + header_.intercept;
    const double whole = std::round(value);
    constexpr double off = 1e-3; // a scaled value may be off a whole number by rounding in single precision
    if (!(std::abs(value - whole) <= off) || !(std::abs(whole) <= std::numeric_limits<std::int32_t>::max()))
      throw InputError(fmt::format("{}: voxel {} has the value {:g}; allowed: whole numbers, one for each label. Is "
                                   "this an image and not a label volume?",
                                   name_, volume_.labels.size(), value));
    volume_.labels.push_back(static_cast<std::int32_t>(whole));
  }

  template <typename Value>
  void take_all(const std::string& bytes, std::size_t count) {
    const bool swapped = header_.big_endian != (std::endian::native == std::endian::big);
    for (std::size_t i = 0; i < count; ++i) {
      std::array<char, sizeof(Value)> raw;
      std::memcpy(raw.data(), bytes.data() + i * sizeof(Value), sizeof(Value));
      if (swapped)
        std::reverse(raw.begin(), raw.end());
      take(static_cast<double>(std::bit_cast<Value>(raw)));
    }
  }

 private:
  const LabelHeader& header_;
  LabelVolume& volume_;
  const std::string& name_;
};

void take_text(const std::string& bytes, std::size_t count, LabelTaker& taker, const std::string& name) {
  const char *at = bytes.data(), *end = at + bytes.size();
  for (std::size_t i = 0; i < count; ++i) {
    while (at < end && std::isspace(static_cast<unsigned char>(*at)) != 0)
      ++at;
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc())
      throw InputError(fmt::format("{}: value {} of {} is missing or no number", name, i, count));
    taker.take(value);
    at = next;
  }
}

void take_binary(const LabelHeader& header, const std::string& bytes, std::size_t count, LabelTaker& taker) {
  switch (header.type) {
  case VoxelType::int8:
    return taker.take_all<std::int8_t>(bytes, count);
  case VoxelType::uint8:
    return taker.take_all<std::uint8_t>(bytes, count);
  case VoxelType::int16:
    return taker.take_all<std::int16_t>(bytes, count);
  case VoxelType::uint16:
    return taker.take_all<std::uint16_t>(bytes, count);
  case VoxelType::int32:
    return taker.take_all<std::int32_t>(bytes, count);
  case VoxelType::uint32:
    return taker.take_all<std::uint32_t>(bytes, count);
  case VoxelType::int64:
    return taker.take_all<std::int64_t>(bytes, count);
  case VoxelType::uint64:
    return taker.take_all<std::uint64_t>(bytes, count);
  case VoxelType::float32:
    return taker.take_all<float>(bytes, count);
  case VoxelType::float64:
    return taker.take_all<double>(bytes, count);
  }
}

/// The header; of a packed file its beginning is unpacked for it.
LabelHeader header_of(LabelFormat format, std::string& bytes, const std::string& name) {
  switch (format) {
  case LabelFormat::nrrd:
    return nrrd_header(bytes, name);
  case LabelFormat::meta:
    return meta_header(bytes, name);
  case LabelFormat::nifti:
    return nifti_header(bytes, name);
  case LabelFormat::packed_nifti:
    break;
  }
  constexpr std::size_t beginning = 352; // of NIfTI-1: header and four bytes that tell of extensions
  LabelHeader header = nifti_header(inflated(bytes, beginning, name) + std::string(1 << 20, '\0'), name);
  header.packed = true;
  return header;
}

} // namespace

bool is_label_volume(const std::filesystem::path& file) {
  return label_format(file).has_value();
}

LabelVolume read_label_volume(const std::filesystem::path& file, double scale_to_metres) {
  const std::string name = file.string();
  const auto format = label_format(file);
  if (!format)
    throw InputError(fmt::format("{}: unknown extension; allowed: .nrrd, .nii, .nii.gz, .mha", name));
  if (!(std::isfinite(scale_to_metres) && scale_to_metres >= 0))
    throw InputError(fmt::format("{}: scale = {}: must be a positive number", name, scale_to_metres));
  std::string bytes = file_contents(file);
  const LabelHeader header = header_of(*format, bytes, name);
  const double voxels =
      static_cast<double>(header.size[0]) * static_cast<double>(header.size[1]) * static_cast<double>(header.size[2]);
  if (!(header.size[0] > 0 && header.size[1] > 0 && header.size[2] > 0 && voxels <= most_voxels))
    throw InputError(fmt::format("{}: {} x {} x {} voxels; allowed: at least one along each axis and {:.0e} in all",
                                 name, header.size[0], header.size[1], header.size[2], most_voxels));
  LabelVolume volume;
  const double unit = scale_to_metres > 0 ? scale_to_metres : header.unit.value_or(unit_of_silence);
  volume.has_unit = header.unit.has_value();
  volume.origin = unit * header.origin;
  volume.axes = unit * header.axes;
  for (int d = 0; d < 3; ++d)
    volume.size[d] = static_cast<int>(header.size[d]);
  const double size = volume.axes.colwise().norm().prod();
  if (!volume.axes.allFinite() || !volume.origin.allFinite() ||
      !(std::abs(volume.axes.determinant()) > 1e-6 * size && size > 0))
    throw InputError(fmt::format("{}: the axes in its header are not finite and independent", name));
  const auto count = static_cast<std::size_t>(voxels);
  volume.labels.reserve(std::min(count, 64 * bytes.size())); // no more than a damaged header can claim
  LabelTaker taker(header, volume, name);
  const std::size_t wanted = count * bytes_of(header.type);
  if (*format == LabelFormat::packed_nifti)
    bytes = inflated(bytes, header.data + wanted, name).substr(header.data);
  else
    bytes.erase(0, header.data);
  if (header.packed && *format != LabelFormat::packed_nifti)
    bytes = inflated(bytes, wanted, name);
  if (header.as_text) {
    take_text(bytes, count, taker, name);
    return volume;
  }
  if (bytes.size() < wanted)
    throw InputError(fmt::format("{}: {} bytes of data where {} x {} x {} voxels need {}; is the file cut short?", name,
                                 bytes.size(), header.size[0], header.size[1], header.size[2], wanted));
  take_binary(header, bytes, count, taker);
  return volume;
}

} // namespace spherecut::topology
