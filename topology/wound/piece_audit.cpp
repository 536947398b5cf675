#include "topology/wound/piece_audit.hpp"

#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/Face_filtered_graph.h>
#include <CGAL/boost/graph/helpers.h>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace spherecut::topology {

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;

Kernel::Point_3 point_of(const Wound& wound, int vertex) {
  const Vector3& x = wound.surface.vertices[vertex];
  return {x.x(), x.y(), x.z()};
}

CgalMesh to_cgal(const SurfaceMesh& mesh) {
  CgalMesh surface;
  for (const Vector3& v : mesh.vertices)
    surface.add_vertex({v.x(), v.y(), v.z()});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    using Vertex = CgalMesh::Vertex_index;
    if (surface.add_face(Vertex(a), Vertex(b), Vertex(c)) == CgalMesh::null_face())
      throw InputError(fmt::format("triangle {} (vertices {}, {}, {}) does not join a manifold", t, a, b, c));
  }
  if (!CGAL::is_closed(surface) || !CGAL::is_valid_polygon_mesh(surface))
    throw InputError("the surface is not closed");
  return surface;
}

/// Distance from x to a face of a voxel.
double distance_to(const VoxelFace& face, double voxel, const Vector3& x) {
  Vector3 d = (x - face.centre).cwiseAbs();
  for (int axis = 0; axis < 3; ++axis)
    if (axis != face.axis)
      d[axis] = std::max(0.0, d[axis] - 0.5 * voxel);
  return d.norm();
}

/// Largest distance from `points` to the faces.
double farthest(const std::vector<Vector3>& points, const std::vector<VoxelFace>& faces, double voxel) {
  std::vector<Vector3> centres;
  centres.reserve(faces.size());
  for (const VoxelFace& face : faces)
    centres.push_back(face.centre);
  const PointTree tree(centres);
  std::vector<PointTree::Found> found;
  double worst = 0;
  for (const Vector3& x : points) {
    // A face whose middle is farther than the nearest one's by more than half a diagonal cannot be nearer.
    const double nearest = std::sqrt(tree.nearest(x).squared_distance);
    found.clear();
    tree.within(x, nearest + std::sqrt(0.5) * voxel, found);
    double least = nearest;
    for (const PointTree::Found& one : found)
      least = std::min(least, distance_to(faces[one.index], voxel, x));
    worst = std::max(worst, least);
  }
  return worst;
}

/// Ids by decreasing volume.
template <class Volume>
std::vector<int> by_volume(int count, const Volume& volume) {
  std::vector<int> ids(count);
  std::iota(ids.begin(), ids.end(), 0);
  std::stable_sort(ids.begin(), ids.end(), [&](int a, int b) { return volume(a) > volume(b); });
  return ids;
}

} // namespace

std::vector<AuditedComponent> audit_components(const SurfaceMesh& surface) {
  namespace pmp = CGAL::Polygon_mesh_processing;
  CgalMesh mesh = to_cgal(surface);
  const auto number = mesh.add_property_map<CgalMesh::Face_index, std::size_t>("f:component").first;
  const std::size_t count = pmp::connected_components(mesh, number);
  std::vector<AuditedComponent> components;
  std::vector<char> done(count, 0);
  for (const CgalMesh::Face_index face : mesh.faces()) {
    if (done[number[face]] != 0)
      continue;
    done[number[face]] = 1;
    const CGAL::Face_filtered_graph<CgalMesh> part(mesh, number[face], number);
    const auto vertices = static_cast<int>(part.number_of_vertices()), faces = static_cast<int>(part.number_of_faces());
    const auto edges = static_cast<int>(part.number_of_halfedges() / 2);
    components.push_back({faces, vertices - edges + faces, CGAL::to_double(pmp::volume(part))});
  }
  return components;
}

std::optional<std::string> component_difference(const Wound& wound) {
  const std::vector<AuditedComponent> audited = audit_components(wound.surface);
  if (audited.size() != wound.components.size())
    return fmt::format("{} components, CGAL tells {}", wound.components.size(), audited.size());
  // Both in the order of their first triangles.
  std::vector<int> order;
  std::vector<char> seen(wound.components.size(), 0);
  double whole = 0;
  for (const int component : wound.component)
    if (seen[component] == 0) {
      seen[component] = 1;
      order.push_back(component);
      whole += std::abs(wound.components[component].volume);
    }
  for (std::size_t k = 0; k < audited.size(); ++k) {
    const WoundComponent& own = wound.components[order[k]];
    if (own.triangles != audited[k].triangles || own.euler != audited[k].euler ||
        !(std::abs(own.volume - audited[k].volume) <= 1e-9 * whole))
      return fmt::format("component {}: {} triangles, Euler characteristic {}, {:.12g} m3; CGAL tells {}, {}, {:.12g}",
                         order[k], own.triangles, own.euler, own.volume, audited[k].triangles, audited[k].euler,
                         audited[k].volume);
  }
  return std::nullopt;
}

double hausdorff_distance(const Wound& wound, const VoxelPieces& pieces, double voxel_size) {
  const int count = static_cast<int>(wound.pieces.size());
  if (count != std::ssize(pieces.skins))
    return std::numeric_limits<double>::infinity();
  const std::vector<int> order = by_volume(count, [&](int p) { return wound.pieces[p].volume; });
  double worst = 0;
  for (int k = 0; k < count; ++k) {
    std::vector<Kernel::Triangle_3> part;
    std::vector<Vector3> samples;
    for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t)
      if (wound.piece_of(static_cast<int>(t)) == order[k]) {
        const Triangle& triangle = wound.surface.triangles[t];
        part.emplace_back(point_of(wound, triangle[0]), point_of(wound, triangle[1]), point_of(wound, triangle[2]));
        Vector3 centroid = Vector3::Zero();
        for (const int v : triangle) {
          samples.push_back(wound.surface.vertices[v]);
          centroid += wound.surface.vertices[v] / 3;
        }
        samples.push_back(centroid);
      }
    worst = std::max(worst, farthest(samples, pieces.skins[k], voxel_size));
    using Primitive = CGAL::AABB_triangle_primitive<Kernel, std::vector<Kernel::Triangle_3>::const_iterator>;
    CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree(part.cbegin(), part.cend());
    tree.accelerate_distance_queries();
    for (const VoxelFace& face : pieces.skins[k])
      worst = std::max(
          worst, std::sqrt(tree.squared_distance(Kernel::Point_3(face.centre.x(), face.centre.y(), face.centre.z()))));
  }
  return worst;
}

} // namespace spherecut::topology
