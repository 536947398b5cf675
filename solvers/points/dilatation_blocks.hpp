// Blocks of background cells over which a nearly incompressible body takes the mean of its volume change. A pressure
// for every point asks for more than the displacements can give: the body locks.
#pragma once

#include "solvers/points/point_table.hpp"

namespace spherecut::solvers {

/// Groups of points by blocks. Every group belongs to one.
struct DilatationBlocks {
  std::vector<int> block;     // of every group
  std::vector<double> volume; // m3, of every block
  [[nodiscard]] int size() const { return static_cast<int>(volume.size()); }
};

/// Two cells a direction make a block, three where their number is odd. Cells that the cut (may be null) hides from one
/// another are of different blocks. A block that the surface leaves less than `least_part` of joins its nearest
/// neighbour.
DilatationBlocks dilatation_blocks(const topology::Domain& domain, const BackgroundCells& cells,
                                   const PointTable& points, const topology::Incision* incision,
                                   double least_part = 0.4);

} // namespace spherecut::solvers
