// Quadrature points of a body at finite strain, eight at a time, with the gradients of all shape functions there. They
// refer to the stress-free state and are evaluated once: whatever the body does, F = I + sum_J u_J (x) grad h_J.
#pragma once

#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/functions.hpp"

#include <span>

namespace spherecut::solvers {

/// Points that are worked on together.
inline constexpr int point_lanes = 8;

/// One number of each point of a group.
struct alignas(64) LaneValues {
  double value[point_lanes]{};
};

/// Groups of up to eight points of one background cell. Lanes that are left repeat the first point with weight zero and
/// gradients zero. Point p is lane p % 8 of group p / 8.
struct PointTable {
  std::vector<int> start{0};         // slots of group g: start[g] .. start[g + 1]
  std::vector<int> nodes;            // node of every slot, ascending within a group
  std::vector<LaneValues> gradients; // [slot][axis], 1/m
  std::vector<double> shares;        // of every slot, m3: how much the group counts in means about the slot's node
  std::vector<LaneValues> weights;   // [group], m3
  std::vector<int> count;            // [group], points that weigh something: the first lanes
  std::vector<int> cell;             // [group], background cell
  std::vector<Vector3> positions;    // [point], m

  [[nodiscard]] int groups() const { return static_cast<int>(count.size()); }
  [[nodiscard]] std::span<const int> nodes_of(int group) const {
    return std::span(nodes).subspan(start[group], start[group + 1] - start[group]);
  }
  [[nodiscard]] const LaneValues* gradients_of(int group) const {
    return gradients.data() + 3 * static_cast<std::size_t>(start[group]);
  }
  /// The first group beyond those of the same cell, from this one on.
  [[nodiscard]] int end_of_cell(int group) const {
    int end = group + 1;
    while (end < groups() && cell[end] == cell[group])
      ++end;
    return end;
  }
  [[nodiscard]] Vector3 gradient(int slot, int lane) const {
    const LaneValues* at = gradients.data() + 3 * static_cast<std::size_t>(slot);
    return {at[0].value[lane], at[1].value[lane], at[2].value[lane]};
  }
};

/// Evaluates the shape functions at the points of all cells, which follow one another by place. Throws NumericalError
/// where a point has no sound support.
PointTable tabulate_points(const BackgroundCells& cells, const Spheres& spheres);

} // namespace spherecut::solvers
