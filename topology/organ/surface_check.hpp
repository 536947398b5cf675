// From polygons of unknown quality to a surface that mechanics can stand on: mended where that is safe and said,
// refused with the place of the defect where it is not.
#pragma once

#include "topology/files/surface_io.hpp"

namespace spherecut::topology {

/// What becomes of pieces of a surface that hang together nowhere: they are separate bodies.
enum class PieceChoice : std::uint8_t { refuse, largest, all };
/// What becomes of closed cavities within a body.
enum class CavityChoice : std::uint8_t { keep, fill, refuse };

struct SurfaceChoices {
  PieceChoice pieces = PieceChoice::refuse;
  CavityChoice cavities = CavityChoice::keep;
};

/// A surface that is closed, 2-manifold, outward oriented (into the cavities, where there are), free of
/// self-intersections and of triangles without area, and what was done to make it so.
struct CheckedSurface {
  SurfaceMesh mesh;
  std::vector<std::string> mended;   // one sentence per kind of mending, empty when the file was sound
  std::vector<std::string> warnings; // about a surface that is sound but looks unintended
};

/// Checks and mends `soup`; `name` (the file) starts every error. Vertex and face numbers in messages count from 0 in
/// the order of the soup; coordinates are in metres.
///
/// Mended: coinciding vertices, vertices that no face uses, repeated faces, polygons of four or more corners
/// (triangulated), edges with more than two faces and vertices where parts of the surface touch (parted, see
/// surface_parting.hpp), slivers (height under 1/1000 of the longest edge: collapsed or flipped), inconsistent or
/// inward orientation, components without volume (left out), small holes (at most 12 edges, and a perimeter of at most
/// a fifth of the square root of the area), and walls of a fold that just pass through each other (at most 20 pairs of
/// triangles, parted by moving vertices no more than 0.5 % of the bounding box's diagonal). Several pieces, and
/// cavities, as chosen.
/// Refused with InputError: no faces, vertices in one plane, an edge whose faces do not tell which side is material, a
/// surface with one side, larger holes, other self-intersections, no volume; pieces and cavities as chosen.
/// Warned: a largest extent over 2 m or under 5 mm, which suggests other units; several pieces, cavities.
CheckedSurface check_surface(const PolygonSoup& soup, const std::string& name, const SurfaceChoices& choices = {});

/// The same mendings for the sheet of a cut, which may be open, in pieces, and pass through itself: sheets that cross
/// along edges, or end on one another, are parted there. Refused are no faces and a surface with one side.
CheckedSurface check_sheet_surface(const PolygonSoup& soup, const std::string& name);

/// read_polygons, then check_surface.
CheckedSurface read_surface(const std::filesystem::path& file, double scale_to_metres = 1,
                            const SurfaceChoices& choices = {});

} // namespace spherecut::topology
