#include "topology/surface/pieces.hpp"

#include "topology/search/disjoint_sets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace spherecut::topology {

namespace {

constexpr int looked_at = 9; // vertices of a component: some may lie on another, where its winding number jumps

/// Solid angle of a triangle seen from x [van Oosterom and Strackee 1983].
double solid_angle(const SurfaceMesh& mesh, const Triangle& t, const Vector3& x) {
  const Vector3 a = mesh.vertices[t[0]] - x, b = mesh.vertices[t[1]] - x, c = mesh.vertices[t[2]] - x;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

struct ComponentTriangles {
  SurfaceComponent component;
  std::vector<int> triangles;
};

std::vector<ComponentTriangles> gather(const SurfaceMesh& mesh) {
  DisjointSets joined(static_cast<int>(mesh.vertices.size()));
  for (const Triangle& t : mesh.triangles)
    for (int e = 0; e < 2; ++e)
      joined.join(t[e], t[e + 1]);
  std::vector<int> number(mesh.vertices.size(), -1);
  std::vector<ComponentTriangles> found;
  for (int t = 0; t < std::ssize(mesh.triangles); ++t) {
    int& component = number[joined.find(mesh.triangles[t][0])];
    if (component < 0) {
      component = static_cast<int>(found.size());
      const Vector3& x = mesh.vertices[mesh.triangles[t][0]];
      found.emplace_back();
      found.back().component.first = t;
      found.back().component.box = {x, x};
    }
    found[component].triangles.push_back(t);
  }
  for (ComponentTriangles& one : found) {
    one.component.triangles = static_cast<int>(one.triangles.size());
    Vector3 sum = Vector3::Zero();
    for (const int t : one.triangles)
      for (const int v : mesh.triangles[t]) {
        sum += mesh.vertices[v];
        one.component.box.lower = one.component.box.lower.cwiseMin(mesh.vertices[v]);
        one.component.box.upper = one.component.box.upper.cwiseMax(mesh.vertices[v]);
      }
    one.component.middle = sum / (3.0 * one.component.triangles);
    for (const int t : one.triangles) {
      const Triangle& corners = mesh.triangles[t];
      const Vector3 a = mesh.vertices[corners[0]] - one.component.middle;
      const Vector3 b = mesh.vertices[corners[1]] - one.component.middle;
      const Vector3 c = mesh.vertices[corners[2]] - one.component.middle;
      one.component.volume += a.dot(b.cross(c)) / 6;
    }
  }
  return found;
}

bool encloses(const SurfaceMesh& mesh, const ComponentTriangles& outer, const ComponentTriangles& inner) {
  int looked = 0, inside = 0;
  const std::size_t stride = std::max<std::size_t>(1, inner.triangles.size() / looked_at);
  for (std::size_t k = 0; k < inner.triangles.size(); k += stride) {
    const Vector3& x = mesh.vertices[mesh.triangles[inner.triangles[k]][0]];
    ++looked;
    if ((x.array() < outer.component.box.lower.array()).any() || (x.array() > outer.component.box.upper.array()).any())
      continue;
    double angle = 0;
    for (const int t : outer.triangles)
      angle += solid_angle(mesh, mesh.triangles[t], x);
    inside += std::abs(angle) > 2 * std::numbers::pi ? 1 : 0;
  }
  return 2 * inside > looked;
}

} // namespace

SurfaceComponents find_components(const SurfaceMesh& mesh) {
  std::vector<ComponentTriangles> found = gather(mesh);
  std::stable_sort(found.begin(), found.end(), [](const ComponentTriangles& a, const ComponentTriangles& b) {
    return std::abs(a.component.volume) > std::abs(b.component.volume);
  });
  SurfaceComponents result;
  result.of.resize(mesh.triangles.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) // what encloses it has the greater volume
      if (encloses(mesh, found[j], found[i]))
        found[i].component.within.push_back(static_cast<int>(j));
    for (const int t : found[i].triangles)
      result.of[t] = static_cast<int>(i);
    result.components.push_back(found[i].component);
  }
  return result;
}

} // namespace spherecut::topology
