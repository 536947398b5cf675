// Voronoi cells of nodes clipped by the body: the cells whose force balance is collocated.
#pragma once

#include "topology/domain.hpp"

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

struct CellComplex {
  std::vector<CellFace> faces;
  std::vector<BoundaryFace> boundary;
  /// Corners of the polygons, m: face f owns face_corners[face_start[f] .. face_start[f+1]), a planar boundary face b
  /// boundary_corners[boundary_start[b] ..); curved boundary faces own none.
  std::vector<int> face_start{0}, boundary_start{0};
  std::vector<Vector3> face_corners, boundary_corners;
  std::vector<double> volumes;    // m3, per node
  std::vector<Vector3> centroids; // m, of each cell
  int empty_cells = 0;            // nodes without volume (outside the body or doubled)
};

/// Cell of node i: the points of the body nearer to i than to any other node. Planar parts of the surface clip exactly
/// (voro++ half-spaces); the curved part clips each face polygon by the zero set of Domain::curved_distance, with one
/// extra vertex on each arc. The boundary of a cell on the curved part is what closes it: the area vectors of every
/// cell sum to zero to rounding. `spacings` (m) set the search radius. Throws InputError when a node coincides with
/// another, or when a cell reaches farther than six times its node's spacing inside the body.
CellComplex voronoi_cells(const std::vector<Vector3>& nodes, const std::vector<double>& spacings, const Domain& domain);

} // namespace spherecut::topology
