// Sheets to cut with.
#pragma once

#include "topology/surface/mesh.hpp"

#include <functional>

namespace spherecut::tests {

/// Grid of columns x rows cells over the unit square, placed by a map (s, t) -> m; its normal is d/ds x d/dt.
topology::SurfaceMesh grid_sheet(int columns, int rows, const std::function<Vector3(double, double)>& place);

/// Parallelogram with a corner and two edges, m.
topology::SurfaceMesh flat_sheet(const Vector3& corner, const Vector3& first, const Vector3& second, int columns,
                                 int rows);

/// The same sheet with vertices moved.
topology::SurfaceMesh moved(topology::SurfaceMesh sheet, const std::function<Vector3(const Vector3&)>& move);

} // namespace spherecut::tests
