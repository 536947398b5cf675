// Cells of VTK as polygons. Private to vtk_surface.cpp and vtp_surface.cpp.
#pragma once

#include "topology/files/surface_io.hpp"

#include <cstdint>
#include <span>

namespace spherecut::topology {

/// Adds cells whose corners are connectivity[end of the one before .. its end), numbers of points counted from `base`.
/// Strips become triangles. Throws InputError, starting with `name`, on ends that fall or leave the list, and on
/// numbers outside 0 .. points - 1.
void add_vtk_cells(std::span<const std::int64_t> connectivity, std::span<const std::int64_t> ends, bool are_strips,
                   std::int64_t base, std::int64_t points, const std::string& name, PolygonSoup& soup);

} // namespace spherecut::topology
