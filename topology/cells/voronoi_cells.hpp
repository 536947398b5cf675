// Voronoi cells of nodes clipped by the body: the cells whose force balance is collocated.
#pragma once

#include "topology/incision/incision.hpp"

namespace spherecut::topology {

/// Face between the cells of two nodes. Seen from `second` its area vector changes sign: fluxes through it are
/// conservative by construction.
struct CellFace {
  int first = -1, second = -1;
  Vector3 area = Vector3::Zero();     // m2, from first to second
  Vector3 centroid = Vector3::Zero(); // m
};

/// Piece of the body's surface that belongs to a cell.
struct BoundaryFace {
  int node = -1;
  int plane = -1;                     // index into Domain::planes(), -1 for the curved part
  Vector3 area = Vector3::Zero();     // m2, outward
  Vector3 centroid = Vector3::Zero(); // m, on the surface
};

/// Face between the cells of two nodes that do not see each other: a part of the lips of a cut.
struct LipFace {
  int node = -1;
  int beyond = -1;                    // node on the other side; of a lip pair, the partner
  Vector3 area = Vector3::Zero();     // m2, out of the cell of `node`
  Vector3 centroid = Vector3::Zero(); // m
};

struct CellComplex {
  std::vector<CellFace> faces;
  std::vector<BoundaryFace> boundary;
  std::vector<LipFace> lips; // in twos: 2k and 2k + 1 are the same polygon seen from its two nodes, areas opposite
  /// Corners of the polygons, m: face f owns face_corners[face_start[f] .. face_start[f+1]), a planar boundary face b
  /// boundary_corners[boundary_start[b] ..), the lips 2k and 2k + 1 lip_corners[lip_start[k] ..); curved boundary faces
  /// own none.
  std::vector<int> face_start{0}, boundary_start{0}, lip_start{0};
  std::vector<Vector3> face_corners, boundary_corners, lip_corners;
  std::vector<double> volumes;    // m3, per node
  std::vector<Vector3> centroids; // m, of each cell
  std::vector<double> reaches;    // m, from the node to the farthest corner or centroid of its cell's faces
  std::vector<Vector3> sites;     // m, the nodes as the cells take them (partners mirrored about their sheet)
  int empty_cells = 0;            // nodes without volume (outside the body or doubled)
};

/// Cell of node i: the points of the body nearer to i than to any other node. Planar parts of the surface clip exactly
/// (voro++ half-spaces); the curved part clips each face polygon by the zero set of Domain::curved_distance, with one
/// extra vertex on each arc. The boundary of a cell on the curved part is what closes it: the area vectors of every
/// cell sum to zero to rounding, lips included. `spacings` (m) set the search radius. With an incision, faces between
/// nodes that do not see each other (those on its sheets lifted off them, see lip_lift.hpp) become lips, but for what
/// of them lies ahead of the front, which is an ordinary face between the same two nodes. The face between the partners
/// of a lip pair lies in the tangent plane of the sheet: the two count as if they were mirrored about it, which moves
/// them by no more than they are off it. Throws InputError when a node coincides with another, or when a
/// cell reaches farther than six times its node's spacing inside the body.
CellComplex voronoi_cells(const std::vector<Vector3>& nodes, const std::vector<double>& spacings, const Domain& domain,
                          const Incision* incision = nullptr);

} // namespace spherecut::topology
