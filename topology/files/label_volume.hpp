// Label volumes, as segmentations leave them: NRRD, NIfTI-1 and MetaImage. Their headers are a page each; there is no
// library for all three that is small (ITK is some hundred megabytes), so they are read here, and zlib unpacks them.
#pragma once

#include "topology/files/surface_io.hpp"

#include <cstdint>
#include <optional>

namespace spherecut::topology {

/// Whether the extension (.nrrd, .nii, .nii.gz, .mha, any case) is that of a label volume.
bool is_label_volume(const std::filesystem::path& file);

/// A label for every voxel of a box; the centre of voxel (i, j, k) is at origin + axes (i, j, k).
struct LabelVolume {
  std::array<int, 3> size{};
  Vector3 origin = Vector3::Zero();   // m
  Matrix3 axes = Matrix3::Identity(); // m; columns: from a voxel to the next
  bool has_unit = false;              // the header names a unit of length
  std::vector<std::int32_t> labels;   // the first index runs fastest
};

/// Reads a volume of whole numbers. Lengths are taken in the header's unit, millimetres where it names none, or, when
/// `scale_to_metres` is not 0, in that. Throws InputError, naming the file and what is wrong, when it is missing, cut
/// short, of other dimensions than three, of colours or vectors, detached from its data, not of whole numbers from
/// -2^31 to 2^31 - 1, larger than 4e8 voxels, or has axes that are not independent.
LabelVolume read_label_volume(const std::filesystem::path& file, double scale_to_metres = 0);

/// Surface of the voxels of one label, and what there is to say about it.
struct LabelSurface {
  PolygonSoup soup; // m; closed, outward
  std::vector<std::string> remarks;
};

/// OpenVDB's dual surface of the label's voxels, relaxed as a constrained surface net [Gibson 1998]: every vertex stays
/// between its eight voxel centres, so that no centre changes sides and a wall of one voxel stays a wall. Without
/// `label` the only one but 0 is taken. Throws InputError, starting with `name`, when the volume does not hold it, or,
/// without one, holds none or several, which are listed.
LabelSurface label_surface(const LabelVolume& volume, std::optional<int> label, const std::string& name);

} // namespace spherecut::topology
