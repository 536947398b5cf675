// Search structure over spheres: which spheres may hold a point. A coarse grid whose cells are split into octants where
// the spheres are small, so that radii may differ by an order of magnitude.
#pragma once

#include "topology/base/types.hpp"

#include <memory>
#include <span>

namespace spherecut::solvers {

/// Immutable; queries are thread safe.
class SphereGrid {
 public:
  static constexpr int lanes = 8; // members of a cell are padded to a multiple of this

  /// The spheres that touch a cell. All arrays hold `padded` readable entries; those beyond ids.size() belong to no
  /// sphere and carry an infinite inverse_square_radius, so that no point passes the test s2 < 1.
  struct Cell {
    std::span<const int> ids; // ascending
    const double *x, *y, *z;  // centres, m
    const double* inverse_square_radius;
    int padded;
  };

  SphereGrid() = default;
  /// Centres must be finite and radii positive, or 0 for a sphere that holds nothing (the caller checks).
  SphereGrid(const std::vector<Vector3>& centres, const std::vector<double>& radii);

  /// The cell of x, outside the box of all centres that of the nearest place in it.
  [[nodiscard]] Cell find(const Vector3& x) const;

 private:
  struct alignas(64) Block {
    std::array<double, lanes> lane;
  };
  struct Node {
    int first_child = -1; // eight consecutive nodes, or -1 for a leaf
    int count = 0;        // members of a leaf
    int first_id = 0;     // into ids_, a multiple of `lanes`
    /// Into blocks_: x, y, z, inverse square radius, one after the other.
    [[nodiscard]] int first_block() const { return first_id / lanes * 4; }
  };
  struct Builder;
  struct Run {
    int sphere, first, last; // root cells
  };
  [[nodiscard]] std::vector<Run> runs_of(const std::vector<Vector3>& centres, const std::vector<double>& radii,
                                         double side) const;

  Vector3 origin_ = Vector3::Zero();
  double inverse_side_ = 1; // of a root cell, 1/m
  std::array<int, 3> roots_{1, 1, 1};
  std::vector<Node> nodes_;
  std::vector<int> ids_;
  std::shared_ptr<Block[]> blocks_; // never written again: copies of the grid share it
};

} // namespace spherecut::solvers
