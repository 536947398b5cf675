// A sheet that grows from its front: every point of the border inside the body moves, and a strip of triangles fills
// what it has swept. What a tear does; a blade's sheet grows by its own sweep (blade.hpp).
#pragma once

#include "topology/incision/incision.hpp"

#include <functional>

namespace spherecut::topology {

struct FrontGrowth {
  std::vector<SurfaceMesh> sheets; // those of the incision, each continued: vertices and triangles keep their places
  int triangles = 0;               // added
  double area = 0;                 // m2, of these, parts outside the body included
};

/// An edge of the border of a sheet, in the direction of its triangle.
struct BorderEdge {
  int from, to;
};

/// Edges of the border of one sheet that are front, at least in part.
std::vector<BorderEdge> front_edges(const Incision& incision, int sheet);

/// Moves every vertex of the front by motion(frame of the front there), m, in the rest frame. Border vertices just
/// outside the body move with the nearest point of the front, and sideways where that would take them into the body, so
/// that the sheet goes on reaching through the surface.
/// New triangles have edges of about `edge` m: longer motions make several rows, vertices that come closer to one
/// another than 0.35 edges become one, edges that stretch beyond 1.5 edges are halved. Motions under 0.02 edges count
/// as none. Throws InputError when `edge` is not positive or a motion is not finite.
FrontGrowth grow_front(const Incision& incision, const std::function<Vector3(const FrontFrame&)>& motion, double edge);

} // namespace spherecut::topology
