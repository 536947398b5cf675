#include "topology/surface/remeshing.hpp"

#include "topology/base/errors.hpp"

#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_mesh_to_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <cmath>
#include <cstddef>
#include <fmt/format.h>

namespace spherecut::topology {

namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Simple_cartesian<double>;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;

} // namespace

SurfaceMesh remesh_isotropic(const SurfaceMesh& mesh, double edge, int iterations) {
  if (!(std::isfinite(edge) && edge > 0))
    throw InputError(fmt::format("remeshing edge = {} m: must be a positive number", edge));
  std::vector<Kernel::Point_3> points;
  points.reserve(mesh.vertices.size());
  for (const Vector3& v : mesh.vertices)
    points.emplace_back(v.x(), v.y(), v.z());
  std::vector<std::array<std::size_t, 3>> polygons;
  polygons.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    polygons.push_back(
        {static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});
  if (!pmp::is_polygon_soup_a_polygon_mesh(polygons))
    throw InputError("remeshing needs a manifold, consistently oriented surface");

  CgalMesh surface;
  pmp::polygon_soup_to_polygon_mesh(points, polygons, surface);
  pmp::isotropic_remeshing(faces(surface), edge, surface, pmp::parameters::number_of_iterations(iterations));

  points.clear();
  polygons.clear();
  pmp::polygon_mesh_to_polygon_soup(surface, points, polygons);
  SurfaceMesh result;
  result.vertices.reserve(points.size());
  for (const Kernel::Point_3& p : points)
    result.vertices.emplace_back(p.x(), p.y(), p.z());
  result.triangles.reserve(polygons.size());
  for (const auto& t : polygons)
    result.triangles.push_back({static_cast<int>(t[0]), static_cast<int>(t[1]), static_cast<int>(t[2])});
  return result;
}

} // namespace spherecut::topology
