// The pieces that an incision leaves of a body, counted by flooding voxels: a check on the combinatorial count, taken
// at checkpoints.
#pragma once

#include "topology/domain/level_set.hpp"
#include "topology/incision/incision.hpp"

namespace spherecut::topology {

/// A side of a voxel.
struct VoxelFace {
  Vector3 centre; // m
  int axis;       // it stands across
};

struct VoxelPieces {
  std::vector<double> volumes; // m3, of the pieces, largest first: voxels inside, so to about area * voxel size / 2
  double crumbs = 0;           // m3, of what is smaller than the smallest piece, together
  std::vector<std::vector<VoxelFace>> skins; // per piece, the faces of its voxels that bound it; only when asked for
};

/// Connected pieces of the voxels inside `organ`, where two neighbours along an axis are connected unless a sheet
/// crosses the line between their centres. Voxels within sqrt(3)/2 voxels of a sheet are left out, the rest is flooded
/// (OpenVDB), then they join the pieces they see. What has fewer than `fewest_voxels` counts as crumbs: where a sheet
/// meets the surface at a small angle, single voxels come loose.
VoxelPieces count_pieces(const LevelSet& organ, const Incision& incision, int fewest_voxels = 27,
                         bool with_skins = false);

} // namespace spherecut::topology
