// The header of a label volume, whatever its format. Private to label_volume.cpp.
#pragma once

#include "topology/base/types.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace spherecut::topology {

enum class VoxelType : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

struct LabelHeader {
  std::array<std::int64_t, 3> size{};
  VoxelType type = VoxelType::uint8;
  bool big_endian = false;
  bool packed = false;              // by gzip or zlib
  bool as_text = false;             // numbers in words
  double slope = 1, intercept = 0;  // of the values
  std::size_t data = 0;             // offset of the first byte of data
  std::optional<double> unit;       // m; nothing when the header names none
  Vector3 origin = Vector3::Zero(); // in that unit
  Matrix3 axes = Matrix3::Identity();
};

// All throw InputError, starting with `name`, at what they cannot take.
LabelHeader nrrd_header(const std::string& bytes, const std::string& name);
LabelHeader nifti_header(const std::string& bytes, const std::string& name);
LabelHeader meta_header(const std::string& bytes, const std::string& name);

} // namespace spherecut::topology
