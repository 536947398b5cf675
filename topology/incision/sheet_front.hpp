// What an incision needs to know of its sheets before it can be asked: that they are sheets, where their border lies
// inside the body, and how much of them does. Used by the incision and by what makes sheets.
#pragma once

#include "topology/incision/incision.hpp"
#include "topology/search/box_tree.hpp"

#include <string>

namespace spherecut::topology {

/// Throws InputError, starting with `name`, unless the sheet has triangles, is finite, consistently oriented and
/// 2-manifold with border, every height of a triangle is at least 1e-6 of its longest edge, and every longest edge at
/// least 1e-9 m.
void check_sheet(const SurfaceMesh& sheet, const std::string& name);

/// Area of the sheet inside the body, m2: triangles over 1/128 of the body's size that may reach its surface are
/// divided first, then clipped where the distance, taken as linear, is zero.
double area_inside(const SurfaceMesh& sheet, const Domain& domain);

/// Whether any point of the sheet is found inside the body by the same division.
bool reaches_inside(const SurfaceMesh& sheet, const Domain& domain);

/// Directions of the front at one end of a piece of it.
struct FrontEnd {
  Vector3 ahead, normal; // unit, orthogonal
  bool corner = false;   // the border turns here by more than 40 degrees, inside the body
};

/// A piece of the front with the directions at its ends, which neighbouring pieces share unless they meet at a corner.
struct FrontPiece {
  FrontSegment segment;
  FrontEnd from, to;
};

/// A triangle of one of several sheets.
struct SheetTriangle {
  int sheet, triangle;
};

/// triangle_neighbours of a sheet.
using Neighbours = std::vector<std::array<int, 3>>;

/// Border of the sheets deeper inside the body than 1e-9 of its size, less what lies within 1e-7 of its size of another
/// sheet, or of a part of the same sheet that shares no vertex with it. Chains come in order. `triangles` lists
/// those of all sheets, `tree` holds their boxes, enlarged by that tolerance.
std::vector<FrontPiece> find_front(const std::vector<SurfaceMesh>& sheets, const std::vector<Neighbours>& neighbours,
                                   const std::vector<SheetTriangle>& triangles, const BoxTree& tree,
                                   const Domain& domain);

/// Tolerance within which a border abuts on another sheet, in units of the body's size (diagonal of its box).
constexpr double abutting = 1e-7;

} // namespace spherecut::topology
