// Background cells for the quadrature of the weak form: an octree over the body, independent of any mesh.
#pragma once

#include "solvers/elasticity/regions.hpp"
#include "solvers/nodes/nodes.hpp"

#include <span>

namespace spherecut::solvers {

struct QuadraturePoint {
  Vector3 position;
  double weight; // m3
};

/// A leaf of the octree, m. Cells first_cell .. last_cell - 1 share it out: one, or several where a sheet divides it.
struct BackgroundBox {
  Vector3 centre, half;
  int first_cell = 0, last_cell = 0;
};

/// Points of all cells; cell c owns points start[c] .. start[c+1]. The weights add up to the volume of the body.
struct BackgroundCells {
  std::vector<int> start{0};
  std::vector<QuadraturePoint> points;
  std::vector<BackgroundBox> boxes;
  [[nodiscard]] std::span<const QuadraturePoint> of(int cell) const {
    return std::span(points).subspan(start[cell], start[cell + 1] - start[cell]);
  }
};

struct BackgroundOptions {
  double cell_size = 1.0; // edge of a cell that is asked for, in units of the local spacing h
  int quadrature = 2;     // rule of a cell, exact to degree 2 quadrature - 1: 1, 2 or 3
  // The basis is enriched at the front of an incision: what is integrated goes with 1 / r there, and points are placed
  // for that.
  bool enriched = true;
  // Halving a cell that is a little too large would cost eight times the points: where the spacing is graded, cells
  // range from slack / 2 to slack times the size asked for.
  double slack = 1.6;
  // Faces between materials; null: none. Octants of a cell that one passes are divided by it, and each part has a point
  // of its own. Not together with an incision.
  std::shared_ptr<const MaterialRegions> regions{};
};

/// Cells inside the body carry their centre (rule 1), six points (2) or 3 x 3 x 3 Gauss points (3). Cells that meet the
/// surface are cut into octants, each of which carries one point at the centroid of its part inside, weighted by that
/// part's volume. Cells that a sheet of the incision (null: uncut) may pass through are cut into octants and these by
/// the sheet's plane; the points that do not see one another make cells of their own. Octants that the front passes are
/// divided once more, and the points of parts near the front stand where r is the harmonic mean of r over the part: so
/// each is exact for 1 / r where its centroid is up to 20 % off.
BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options = {}, const topology::Incision* incision = nullptr);

/// Most points of one cell.
inline constexpr int most_cell_points = 27;

/// Points of a quadrature rule over the surface, `weight` is an area, m2. Triangles of the tessellation are divided to
/// edges of at most `edge` local spacings; each carries three points, exact for quadratic functions, or its centroid
/// alone where it is less than `centroid_below` spacings long. Triangles that a sheet of the incision (null: uncut)
/// meets are divided by it. With `region` only triangles whose bounding boxes meet it count, the same points as
/// without.
struct SurfacePoint {
  Vector3 position;
  Vector3 normal;
  double weight;
};
std::vector<SurfacePoint> surface_quadrature(const topology::Domain& domain, const NodeCloud& nodes, double edge = 0.5,
                                             double centroid_below = 0, const topology::Incision* incision = nullptr,
                                             const BoundingBox* region = nullptr);

/// The same over both faces of an incision, as far as they lie inside the body: positions lip_offset spacings off the
/// sheet, normals out of the material. Triangles smaller than an equilateral one of edge `centroid_below` spacings
/// carry their centroid alone; many of these that lie together make one point, of about half their distance to the
/// front in size, a distance of `finest` to one spacing.
std::vector<SurfacePoint> lip_quadrature(const topology::Incision& incision, const NodeCloud& nodes, double edge = 0.5,
                                         double centroid_below = 0.36, const BoundingBox* region = nullptr,
                                         double finest = 0.25);

} // namespace spherecut::solvers
