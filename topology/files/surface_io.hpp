// Reading and writing surface files: OBJ, PLY, STL, OFF, VTK, VTP.
#pragma once

#include "topology/surface/mesh.hpp"

#include <filesystem>
#include <string>

namespace spherecut::topology {

/// Polygons as a file gives them: nothing is known of their orientation or of how they join.
struct PolygonSoup {
  std::vector<Vector3> vertices;          // m
  std::vector<std::vector<int>> polygons; // indices into vertices
};

/// Reads the polygons of a file, through CGAL but for VTK's; the extension (.obj, .ply, .stl, .off, .vtk, .vtp, any
/// case) tells the format. PLY and STL may be ASCII or binary; of VTK files see vtk_surface.hpp. Every coordinate is
/// multiplied by scale_to_metres. All indices are in range, all coordinates finite, every polygon has 3 to 256 corners.
/// STL facets are joined where corners coincide exactly. Throws InputError, naming the file and the line, element or
/// byte, when the file is missing, empty, cut short, not of the format its extension tells, or holds numbers that are
/// not finite or indices out of range.
PolygonSoup read_polygons(const std::filesystem::path& file, double scale_to_metres = 1);

/// The bytes of a file of at most 2 GB. Throws InputError, naming it, when it is missing, no file, empty, larger, or
/// cannot be read.
std::string file_contents(const std::filesystem::path& file);

/// Throws InputError, starting with `name`, unless all coordinates are finite, all indices in range, and every polygon
/// has 3 to 256 corners.
void require_readable(const PolygonSoup& soup, const std::string& name);

/// Writes OBJ (text, all digits), or PLY (binary, doubles), by extension. Throws InputError when the extension is
/// another or the file cannot be written completely.
void write_surface(const std::filesystem::path& file, const SurfaceMesh& mesh);

} // namespace spherecut::topology
