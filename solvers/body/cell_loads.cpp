#include "solvers/body/cell_loads.hpp"

#include "solvers/body/surface_patches.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

namespace {

constexpr double smooth_cosine = 0.8; // of the angle between a point's normal and the cell's

/// A polygon, as triangles about its centroid.
struct LoadedPolygon {
  const std::vector<Vector3>& corners;
  int begin, end;
  Vector3 centroid;

  template <class Visit>
  void triangles(const Visit& visit) const {
    for (int k = begin; k < end; ++k)
      visit(centroid, corners[k], corners[k + 1 < end ? k + 1 : begin]);
  }
};

using Function = std::function<Vector3(const Vector3& x, const Vector3& normal)>;

/// Over the cone from `apex` over the polygon, N.
Vector3 body_force_on(const Vector3& apex, const LoadedPolygon& base, const Loads& loads) {
  constexpr double near = 0.5854101966249685, far = 0.1381966011250105;
  Vector3 force = Vector3::Zero();
  base.triangles([&](const Vector3& a, const Vector3& b, const Vector3& c) {
    const double volume = std::abs((a - apex).dot((b - apex).cross(c - apex))) / 6;
    if (volume <= 0)
      return;
    const Vector3 sum = apex + a + b + c;
    for (const Vector3& vertex : {apex, a, b, c})
      force += 0.25 * volume * loads.body_force(far * sum + (near - far) * vertex);
  });
  return force;
}

/// Over the polygon of the given area vector, N.
Vector3 traction_on(const LoadedPolygon& face, const Vector3& area, const Function& traction) {
  const double size = area.norm();
  if (!traction || size <= 0)
    return Vector3::Zero();
  const Vector3 normal = area / size;
  Vector3 force = Vector3::Zero();
  face.triangles([&](const Vector3& a, const Vector3& b, const Vector3& c) {
    const double triangle = 0.5 * (b - a).cross(c - a).norm();
    for (const Vector3& point : {Vector3(0.5 * (a + b)), Vector3(0.5 * (b + c)), Vector3(0.5 * (c + a))})
      force += triangle / 3 * traction(point, normal);
  });
  return force;
}

/// Adds the traction on the curved part of the surface. The area vector of a cell is exact there (by closure), which is
/// all that a smooth piece needs; over a sharp edge it is the sum of two faces, and their points tell them apart.
void add_curved_traction(const topology::CellComplex& cells, const Problem& problem, std::vector<Vector3>& forces) {
  if (std::none_of(cells.boundary.begin(), cells.boundary.end(),
                   [](const topology::BoundaryFace& face) { return face.plane < 0; }))
    return;
  const std::vector<SurfacePoint> points =
      surface_quadrature(*problem.domain, problem.nodes, 0.5, 0, problem.incision.get());
  const topology::PointTree tree(problem.nodes.positions);
  std::vector<std::vector<int>> points_of_node(forces.size());
  for (int k = 0; k < std::ssize(points); ++k) {
    const auto& planes = problem.domain->planes();
    const double near = 1e-6 * problem.nodes.spacings[0];
    if (std::none_of(planes.begin(), planes.end(), [&](const Plane& plane) {
          return std::abs(plane.signed_distance(points[k].position)) < near && plane.normal.dot(points[k].normal) > 0.9;
        }))
      points_of_node[nearest_in_sight(tree, problem.nodes.positions, problem.opaque.get(), points[k].position)]
          .push_back(k);
  }
  for (const topology::BoundaryFace& face : cells.boundary) {
    if (face.plane >= 0)
      continue;
    const std::vector<int>& own = points_of_node[face.node];
    const Vector3 normal = face.area.normalized();
    const bool smooth =
        std::all_of(own.begin(), own.end(), [&](int k) { return points[k].normal.dot(normal) > smooth_cosine; });
    if (smooth)
      forces[face.node] += face.area.norm() * problem.loads.traction(face.centroid, normal);
    else
      for (const int k : own)
        forces[face.node] += points[k].weight * problem.loads.traction(points[k].position, points[k].normal);
  }
}

} // namespace

std::vector<Vector3> cell_loads(const topology::CellComplex& cells, const Problem& problem,
                                const Matrix3& initial_stress) {
  const std::vector<Vector3>& x = problem.nodes.positions;
  std::vector<Vector3> forces(x.size(), Vector3::Zero());
  if (problem.loads.body_force) {
    for (int f = 0; f < std::ssize(cells.faces); ++f)
      for (const int node : {cells.faces[f].first, cells.faces[f].second})
        forces[node] += body_force_on(
            x[node], {cells.face_corners, cells.face_start[f], cells.face_start[f + 1], cells.faces[f].centroid},
            problem.loads);
  }
  const auto add = [&](int node, const LoadedPolygon& face, const Vector3& area, const Function& traction) {
    if (problem.loads.body_force)
      forces[node] += body_force_on(x[node], face, problem.loads);
    forces[node] += traction_on(face, area, traction) + initial_stress * area;
  };
  for (int b = 0; b < std::ssize(cells.boundary); ++b) {
    const topology::BoundaryFace& face = cells.boundary[b];
    add(face.node, {cells.boundary_corners, cells.boundary_start[b], cells.boundary_start[b + 1], face.centroid},
        face.area, problem.loads.traction);
  }
  if (problem.loads.traction)
    add_curved_traction(cells, problem, forces);
  for (int l = 0; l < std::ssize(cells.lips); ++l) {
    const topology::LipFace& face = cells.lips[l];
    add(face.node, {cells.lip_corners, cells.lip_start[l / 2], cells.lip_start[l / 2 + 1], face.centroid}, face.area,
        problem.loads.lip_traction);
  }
  return forces;
}

} // namespace spherecut::solvers
