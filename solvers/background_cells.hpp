// Background cells for the quadrature of the weak form: an octree over the body, independent of any mesh.
#pragma once

#include "solvers/nodes.hpp"

namespace spherecut::solvers {

struct QuadraturePoint {
  Vector3 position;
  double weight; // m3
};

/// Points of all cells; cell c owns points start[c] .. start[c+1]. The weights add up to the volume of the body.
struct BackgroundCells {
  std::vector<int> start{0};
  std::vector<QuadraturePoint> points;
};

struct BackgroundOptions {
  double cell_size = 1.0; // largest edge of a cell, in units of the local spacing h
  int gauss = 2;          // points per direction, 1 to 3
};

/// Cells inside the body carry gauss^3 Gauss points. Cells that meet the surface are cut into octants, each of which
/// carries one point at the centroid of its part inside, weighted by that part's volume.
BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options = {});

/// Points of a quadrature rule over the surface, `weight` is an area, m2. Triangles of the tessellation are divided to
/// edges of at most `edge` local spacings; each carries three points, exact for quadratic functions, or its centroid
/// alone where it is less than 0.6 of that size anyway.
struct SurfacePoint {
  Vector3 position;
  Vector3 normal;
  double weight;
};
std::vector<SurfacePoint> surface_quadrature(const topology::Domain& domain, const NodeCloud& nodes, double edge = 0.5,
                                             double centroid_below = 0);

} // namespace spherecut::solvers
