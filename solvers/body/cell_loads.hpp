// Forces that the loads of a problem exert on the cells of its nodes.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "topology/cells/voronoi_cells.hpp"

namespace spherecut::solvers {

/// Per node, N: body force, traction on the surface and on the lips of a cut, and what `initial_stress` (Pa; stress =
/// C strain - initial_stress) asks of the cell's part of the surface and of the lips: it acts through all faces between
/// cells, and the area vectors of a cell add up to zero. Midpoints would cost as much accuracy as the whole
/// discretisation: loads are integrated over the cells' own polygons, by a quadratic rule on tetrahedra from the node
/// and on triangles. The two lips of a face carry opposite pressures to the last bit.
std::vector<Vector3> cell_loads(const topology::CellComplex& cells, const Problem& problem,
                                const Matrix3& initial_stress);

} // namespace spherecut::solvers
