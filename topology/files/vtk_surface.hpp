// Polygons of VTK files: the legacy format (.vtk) and the XML one (.vtp). Used by surface_io alone.
#pragma once

#include "topology/files/surface_io.hpp"

namespace spherecut::topology {

/// Legacy file of a POLYDATA set, text or binary, versions 1 to 5: points, polygons and triangle strips. What follows
/// them is not looked at. Throws InputError, starting with `name`, at the first thing that cannot be so.
PolygonSoup vtk_polygons(const std::string& bytes, const std::string& name);

/// XML file of PolyData: arrays as text, base64 or appended (raw or base64), packed by zlib or not. Lines and vertices
/// are left out. Throws InputError likewise.
PolygonSoup vtp_polygons(const std::string& bytes, const std::string& name);

} // namespace spherecut::topology
