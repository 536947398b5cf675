// A quarter of the half ball as 27-node hexahedra, graded towards the edge of the cap.
#pragma once

#include "topology/base/types.hpp"

#include <array>
#include <vector>

namespace spherecut::experiments {

/// 27 node positions (m), first direction fastest, edges and faces curved through their middle nodes.
using Brick = std::array<Vector3, 27>;

/// Elements along each part of the mesh.
struct HalfBallResolution {
  int core = 1;   // a side of the square block about the axis; twice as many around the quarter turn
  int cap = 3;    // from that block to the edge of the cap
  int free = 4;   // from the edge of the cap to 45 degrees
  int depth = 5;  // from the surface to the block in the middle
  int middle = 2; // height of the block in the middle
};

/// The quarter x >= 0, y >= 0 of the half ball |x| <= 1, z >= 0. Circles of constant latitude on the surface, the edge
/// of the cap (sin t = cap_radius) among them, are lines of the mesh; no element is degenerate.
std::vector<Brick> half_ball_mesh(const HalfBallResolution& resolution, double cap_radius);

/// Volume (m3) by 3 x 3 x 3 Gauss points. Throws NumericalError naming the first brick whose Jacobian is not positive
/// at one of them.
double checked_volume(const std::vector<Brick>& bricks);

} // namespace spherecut::experiments
