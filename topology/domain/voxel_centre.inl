// For sources that use OpenVDB's trees themselves.
#pragma once

#include "topology/base/types.hpp"

#include <openvdb/openvdb.h>

namespace spherecut::topology {

/// The middle of a voxel of that size, m.
inline Vector3 centre(const openvdb::Coord& voxel, double size) {
  return {voxel.x() * size, voxel.y() * size, voxel.z() * size};
}

} // namespace spherecut::topology
