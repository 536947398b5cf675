// A first pass over the bytes of a surface file, before CGAL parses them: finds the place of the first fault, and keeps
// a damaged count from asking for more memory than the file could fill. Used by surface_io alone.
#pragma once

#include <string>
#include <string_view>

namespace spherecut::topology {

enum class SurfaceFormat { obj, ply, stl, off };

/// Most corners that one polygon may have.
inline constexpr int most_corners = 256;

/// Throws InputError, starting with `name`, at the first line or element that cannot be what the format asks for. Gives
/// back the text for CGAL to parse, which for OBJ, OFF and text STL is reduced to vertices and faces. Taken as they
/// are: a byte order mark, comments, NUL and Ctrl-Z at the end, lines that end in CR alone, STL keywords in any case,
/// lines of OBJ that a backslash continues.
std::string checked_text(SurfaceFormat format, std::string text, const std::string& name);

} // namespace spherecut::topology
