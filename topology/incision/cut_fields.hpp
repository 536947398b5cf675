// An incision as level sets (OpenVDB): a cut of no width cannot live in one signed grid, so there are two fields, as in
// level-set methods for cracks [Stolarska et al. 2001]: how far the sheets are, and how far before or behind their
// front.
#pragma once

#include "topology/incision/incision.hpp"

#include <cstddef>

namespace spherecut::topology {

/// One voxel of the band around the sheets.
struct CutVoxel {
  std::array<int, 3> index; // centre at index * voxel size
  float distance;           // m, to the sheets, unsigned
  float ahead;              // m, see CutFields
  bool operator==(const CutVoxel&) const = default;
};

/// Both fields at the voxels within band() of a sheet. `ahead` is the place relative to the front: (x - f) . ahead with
/// the frame of the nearest front point f (see Incision::front_frame), negative behind, where the sheet is; -band()
/// farther than band() from any front. Values are single precision.
class CutFields {
 public:
  /// Throws InputError when the voxel size is not positive and finite or the band not within 1 to 10 voxels.
  explicit CutFields(double voxel_size, double band_voxels = 3);
  ~CutFields();
  CutFields(CutFields&&) noexcept;
  CutFields& operator=(CutFields&&) noexcept;

  /// Brings the fields to `incision`. Where its sheets begin with the triangles of the last one only voxels near new
  /// triangles and near a front that went or came are visited, else all; the fields are the same bit for bit.
  /// Throws InputError when it is null or the fields would need over 2 GB; then nothing has changed.
  void update(const std::shared_ptr<const Incision>& incision);

  /// Trilinear values, m; band() where a voxel around x lies outside the band.
  [[nodiscard]] double distance(const Vector3& x) const;
  [[nodiscard]] double ahead(const Vector3& x) const;

  [[nodiscard]] double voxel_size() const; // m
  [[nodiscard]] double band() const;       // m
  [[nodiscard]] std::size_t memory_bytes() const;
  /// All voxels of the band, in the order of the grid.
  [[nodiscard]] std::vector<CutVoxel> voxels() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace spherecut::topology
