// Sheets of a cut that is there from the start: discs, rectangles, polygons, and files.
#pragma once

#include "topology/surface/mesh.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace spherecut::topology {

// All sheets are open, 2-manifold, of near-equal triangles with edges of about `edge` m, and no edge inside a sheet
// joins two vertices of its border (which would pinch the wall of the wound). They throw InputError, naming the
// argument, its value and the limit, on sizes that are not positive and finite, directions that are zero or parallel,
// edges longer than the sheet's smallest size, or more than a million triangles. Whether a sheet lies in a body is
// checked by Incision.

/// Disc about `centre`; its + side is that of `normal` (any length). Its border is a regular polygon on the circle.
SurfaceMesh make_disc_sheet(const Vector3& centre, const Vector3& normal, double radius, double edge);

/// Rectangle about `centre`, `width` m along normal x up and `height` m along `up` (any length; its part along `normal`
/// is left out). Its + side is that of `normal`.
SurfaceMesh make_rectangle_sheet(const Vector3& centre, const Vector3& normal, const Vector3& up, double width,
                                 double height, double edge);

/// Simple polygon, convex or not, with corners in one plane to 1e-6 of its size; counter-clockwise seen from its +
/// side. Throws InputError also when corners coincide, lie off the plane, or sides cross.
SurfaceMesh make_polygon_sheet(const std::vector<Vector3>& corners, double edge);

/// Sheets from a surface file (surface_io.hpp), open or closed, mended as check_sheet_surface does, and split_bridges.
/// One sentence for each kind of mending goes to `mended`, if there is one. Throws InputError naming the file and the
/// element when the sheet cannot be mended or has degenerate triangles all the same.
SurfaceMesh read_sheet(const std::filesystem::path& file, double scale_to_metres = 1,
                       std::vector<std::string>* mended = nullptr);

/// Splits, in the middle, every edge inside the sheet that joins two vertices of its border. Returns how many; existing
/// vertices keep their places.
int split_bridges(SurfaceMesh& sheet);

} // namespace spherecut::topology
