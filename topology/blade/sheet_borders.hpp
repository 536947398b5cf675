// Borders of growing sheets, for strips that are to abut on them vertex by vertex. Used by the blade sweep alone.
#pragma once

#include "topology/blade/swept_sheets.hpp"

namespace spherecut::topology {

/// A vertex of a sheet.
struct SheetVertex {
  int sheet, vertex;
};

/// The nearer end, within `reach` m, of the sheet's border edge nearest to x; -1 where x is farther than `off` m from
/// that.
int nearest_on_border(const SweptSheets& sheets, int sheet, const Vector3& x, double off, double reach);

/// Vertices from one of a border to one of the same sheet or of another, the shortest way along their borders, in order
/// and with both ends. A way goes from one sheet to the other where they have vertices at the same place, and has both
/// of these there. Nothing when no way is as short as `longest` m.
std::vector<SheetVertex> way_along_borders(const SweptSheets& sheets, const SheetVertex& from, const SheetVertex& to,
                                           double longest);

} // namespace spherecut::topology
