// Signed distance of an organ sampled on a sparse grid (OpenVDB).
#pragma once

#include "topology/surface/mesh.hpp"

#include <cstddef>
#include <functional>
#include <memory>

namespace spherecut::topology {

/// Level set of a closed surface, which may have several pieces and cavities: distances at every voxel inside the body
/// and in a band of outside_band() around it, trilinear between voxels. Errors are of the order of the voxel size
/// squared where the distance is smooth and stay below a voxel near edges. Deep inside (over ten voxels), close to
/// where several parts of the surface are equally far, the nearest triangle that OpenVDB passes from voxel to voxel can
/// be a wrong one: there the depth is too great by up to a few voxels at about one point in a thousand. Queries are
/// const and thread safe. The grid is built on one thread, so that the same surface gives the same bits.
class LevelSet {
 public:
  /// voxel_size in m; 0 derives 1/128 of the largest extent. Throws InputError when the surface is empty or not finite,
  /// when the voxel size is negative, not finite, or over a quarter of the smallest extent (the body would fall between
  /// voxels), and when the grid would need more than memory_limit bytes.
  explicit LevelSet(const SurfaceMesh& surface, double voxel_size = 0, std::size_t memory_limit = 2'000'000'000);
  ~LevelSet();
  LevelSet(LevelSet&&) noexcept;
  LevelSet& operator=(LevelSet&&) noexcept;

  /// Signed distance, m, negative inside; farther outside than outside_band() the value is outside_band().
  [[nodiscard]] double distance(const Vector3& x) const;

  /// Gradient of the distance by central differences over one voxel: near unit length where the distance is smooth,
  /// zero outside the band.
  [[nodiscard]] Vector3 gradient(const Vector3& x) const;

  /// Whether distance(x) < 0: right except within about a voxel of the surface.
  [[nodiscard]] bool inside(const Vector3& x) const;

  /// A triangle close to the one nearest to x, -1 outside the band: a starting point for an exact search.
  [[nodiscard]] int near_triangle(const Vector3& x) const;

  /// Calls visit(lower, upper) for boxes of voxel indices, inclusive, that together hold every voxel with a distance
  /// below zero once. A voxel's centre is at index * voxel_size().
  void visit_inside(const std::function<void(const std::array<int, 3>&, const std::array<int, 3>&)>& visit) const;

  [[nodiscard]] double voxel_size() const;        // m
  [[nodiscard]] double outside_band() const;      // m
  [[nodiscard]] std::size_t memory_bytes() const; // of both grids: distances and triangles
  [[nodiscard]] std::size_t active_voxels() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace spherecut::topology
