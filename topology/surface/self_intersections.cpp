#include "topology/surface/self_intersections.hpp"

#include "topology/base/errors.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <algorithm>
#include <exception>
#include <fmt/format.h>
#include <iterator>

namespace spherecut::topology {

std::vector<std::pair<int, int>> self_intersections(const SurfaceMesh& mesh) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;
  using Vertex = CgalMesh::Vertex_index;
  CgalMesh surface;
  for (const Vector3& v : mesh.vertices)
    surface.add_vertex({v.x(), v.y(), v.z()});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (surface.add_face(Vertex(a), Vertex(b), Vertex(c)) == CgalMesh::null_face())
      throw InputError(fmt::format("triangle {} (vertices {}, {}, {}) does not join a manifold", t, a, b, c));
  }
  std::vector<std::pair<CgalMesh::Face_index, CgalMesh::Face_index>> found;
  try {
    CGAL::Polygon_mesh_processing::self_intersections(surface, std::back_inserter(found));
  } catch (const std::exception& error) {
    throw InputError(fmt::format("the search for self-intersections failed: {}", error.what()));
  }
  std::vector<std::pair<int, int>> result;
  result.reserve(found.size());
  for (const auto& [first, second] : found) {
    const int a = static_cast<int>(first.idx()), b = static_cast<int>(second.idx());
    result.emplace_back(std::min(a, b), std::max(a, b));
  }
  std::sort(result.begin(), result.end());
  return result;
}

} // namespace spherecut::topology
