#include "topology/surface/mesh.hpp"

#include "topology/base/errors.hpp"
#include "topology/surface/half_edges.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <fmt/format.h>

namespace spherecut::topology {

BoundingBox bounds(const SurfaceMesh& mesh) {
  if (mesh.vertices.empty())
    return {};
  BoundingBox box{mesh.vertices.front(), mesh.vertices.front()};
  for (const Vector3& v : mesh.vertices) {
    box.lower = box.lower.cwiseMin(v);
    box.upper = box.upper.cwiseMax(v);
  }
  return box;
}

double volume(const SurfaceMesh& mesh) {
  // Relative to the box centre, so that a body far from the origin loses no digits.
  const Vector3 origin = bounds(mesh).centre();
  double six_volumes = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3 a = mesh.vertices[t[0]] - origin, b = mesh.vertices[t[1]] - origin, c = mesh.vertices[t[2]] - origin;
    six_volumes += a.dot(b.cross(c));
  }
  return six_volumes / 6;
}

void require_outward(const SurfaceMesh& mesh) {
  if (const double enclosed = volume(mesh); enclosed < 0)
    throw InputError(
        fmt::format("the surface of {} triangles is oriented inwards: it encloses {:.4g} m3; allowed: more "
                    "than 0 (topology::check_surface turns it)",
                    mesh.triangles.size(), enclosed));
}

double area(const SurfaceMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3& a = mesh.vertices[t[0]];
    sum += 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).norm();
  }
  return sum;
}

Vector3 triangle_normal(const SurfaceMesh& mesh, int triangle) {
  const Triangle& t = mesh.triangles[triangle];
  const Vector3& a = mesh.vertices[t[0]];
  return (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
}

std::vector<Vector3> vertex_normals(const SurfaceMesh& mesh) {
  std::vector<Vector3> normals(mesh.vertices.size(), Vector3::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Vector3& a = mesh.vertices[t[0]];
    const Vector3 area_vector = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    for (int v : t)
      normals[v] += area_vector;
  }
  for (Vector3& n : normals)
    n.normalize();
  return normals;
}

std::vector<std::array<int, 3>> triangle_neighbours(const SurfaceMesh& mesh) {
  const HalfEdges edges(mesh);
  std::vector<std::array<int, 3>> neighbours(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e)
      neighbours[t][e] = edges.triangle(mesh.triangles[t][(e + 1) % 3], mesh.triangles[t][e]);
  return neighbours;
}

} // namespace spherecut::topology
