#include "tests/support/mesh_checks.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

namespace spherecut::tests {

int euler_characteristic(const topology::SurfaceMesh& mesh) {
  std::set<int> vertices;
  std::set<std::pair<int, int>> edges;
  for (const Triangle& t : mesh.triangles)
    for (int e = 0; e < 3; ++e) {
      vertices.insert(t[e]);
      edges.insert(std::minmax({t[e], t[(e + 1) % 3]}));
    }
  return static_cast<int>(vertices.size()) - static_cast<int>(edges.size()) + static_cast<int>(mesh.triangles.size());
}

void require_closed_sphere(const topology::SurfaceMesh& mesh) {
  std::map<std::pair<int, int>, int> triangle_of_half_edge;
  std::vector<int> degree(mesh.vertices.size(), 0);
  std::vector<int> some_triangle(mesh.vertices.size(), -1);
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int e = 0; e < 3; ++e) {
      const int v = mesh.triangles[t][e];
      REQUIRE(v >= 0);
      REQUIRE(v < std::ssize(mesh.vertices));
      ++degree[v];
      some_triangle[v] = t;
      REQUIRE(triangle_of_half_edge.emplace(std::pair(v, mesh.triangles[t][(e + 1) % 3]), t).second);
    }
  for (const auto& [half_edge, triangle] : triangle_of_half_edge)
    REQUIRE(triangle_of_half_edge.count({half_edge.second, half_edge.first}) == 1);
  // Turning about a vertex from one of its triangles must meet all of them.
  for (int v = 0; v < std::ssize(mesh.vertices); ++v) {
    REQUIRE(some_triangle[v] >= 0);
    int turned = 0, t = some_triangle[v];
    do {
      const Triangle& triangle = mesh.triangles[t];
      const int corner = static_cast<int>(std::find(triangle.begin(), triangle.end(), v) - triangle.begin());
      t = triangle_of_half_edge.at({v, triangle[(corner + 2) % 3]});
      ++turned;
    } while (t != some_triangle[v] && turned <= degree[v]);
    REQUIRE(turned == degree[v]);
  }
  // Flood over neighbours: one component.
  const auto neighbours = topology::triangle_neighbours(mesh);
  std::vector<bool> reached(mesh.triangles.size(), false);
  std::vector<int> open = {0};
  reached[0] = true;
  std::size_t count = 1;
  while (!open.empty()) {
    const int t = open.back();
    open.pop_back();
    for (const int n : neighbours[t])
      if (!reached[n]) {
        reached[n] = true;
        ++count;
        open.push_back(n);
      }
  }
  REQUIRE(count == mesh.triangles.size());
  REQUIRE(euler_characteristic(mesh) == 2);
  REQUIRE(topology::volume(mesh) > 0);
}

AngleRange angle_range(const topology::SurfaceMesh& mesh) {
  AngleRange range{180, 0};
  for (const Triangle& t : mesh.triangles)
    for (int c = 0; c < 3; ++c) {
      const Vector3 u = mesh.vertices[t[(c + 1) % 3]] - mesh.vertices[t[c]];
      const Vector3 v = mesh.vertices[t[(c + 2) % 3]] - mesh.vertices[t[c]];
      const double angle = std::atan2(u.cross(v).norm(), u.dot(v)) * 180 / std::numbers::pi;
      range.smallest = std::min(range.smallest, angle);
      range.largest = std::max(range.largest, angle);
    }
  return range;
}

} // namespace spherecut::tests
