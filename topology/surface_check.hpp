// From polygons of unknown quality to a surface that mechanics can stand on: mended where that is safe and said,
// refused with the place of the defect where it is not.
#pragma once

#include "topology/surface_io.hpp"

namespace spherecut::topology {

/// A surface that is closed, 2-manifold, in one piece, outward oriented, free of self-intersections and of triangles
/// without area, and what was done to make it so.
struct CheckedSurface {
  SurfaceMesh mesh;
  std::vector<std::string> mended;   // one sentence per kind of mending, empty when the file was sound
  std::vector<std::string> warnings; // about a surface that is sound but looks unintended
};

/// Checks and mends `soup`; `name` (the file) starts every error. Vertex and face numbers in messages count from 0 in
/// the order of the soup; coordinates are in metres.
///
/// Mended: coinciding vertices, vertices that no face uses, repeated faces, polygons of four or more corners
/// (triangulated), slivers (height under 1/1000 of the longest edge: collapsed or flipped), inconsistent or inward
/// orientation, small holes (at most 12 edges, and a perimeter of at most a fifth of the square root of the area), and
/// walls of a fold that just pass through each other (at most 20 pairs of triangles, parted by moving vertices no more
/// than 0.5 % of the bounding box's diagonal).
/// Refused with InputError: no faces, vertices in one plane, an edge with over two faces, a vertex where sheets touch,
/// a surface with one side, several pieces, larger holes, other self-intersections, no volume.
/// Warned: a largest extent over 2 m or under 5 mm, which suggests other units.
CheckedSurface check_surface(const PolygonSoup& soup, const std::string& name);

/// read_polygons, then check_surface.
CheckedSurface read_surface(const std::filesystem::path& file, double scale_to_metres = 1);

} // namespace spherecut::topology
