#include "solvers/nodes/features.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

namespace spherecut::solvers {

namespace {

struct SharpEdge {
  std::array<int, 2> vertices;
  std::array<int, 2> faces;
  bool convex;
  bool used = false;
};

/// Every edge once (first vertex below the second in its first triangle), found through the triangles of each vertex.
std::vector<SharpEdge> sharp_edges(const topology::SurfaceMesh& mesh, double sharp_degrees) {
  const int triangles = static_cast<int>(mesh.triangles.size());
  std::vector<int> start(mesh.vertices.size() + 1, 0);
  for (const Triangle& t : mesh.triangles)
    for (int v : t)
      ++start[v + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  struct Outgoing {
    int to, triangle;
  };
  std::vector<Outgoing> outgoing(3 * mesh.triangles.size()); // half-edges of a vertex
  std::vector<int> fill(start.begin(), start.end() - 1);
  std::vector<Vector3> normals(triangles);
  for (int t = 0; t < triangles; ++t) {
    const Triangle& corner = mesh.triangles[t];
    for (int e = 0; e < 3; ++e)
      outgoing[fill[corner[e]]++] = {corner[(e + 1) % 3], t};
    normals[t] = topology::triangle_normal(mesh, t);
  }
  const double limit = std::cos(sharp_degrees * std::numbers::pi / 180);
  std::vector<SharpEdge> edges;
  for (int t = 0; t < triangles; ++t)
    for (int e = 0; e < 3; ++e) {
      const int a = mesh.triangles[t][e], b = mesh.triangles[t][(e + 1) % 3];
      if (a > b)
        continue;
      for (int k = start[b]; k < start[b + 1]; ++k) {
        const int other = outgoing[k].triangle;
        if (outgoing[k].to != a || !(normals[t].dot(normals[other]) < limit))
          continue;
        const Vector3 along = mesh.vertices[b] - mesh.vertices[a];
        edges.push_back({{a, b}, {t, other}, normals[t].cross(normals[other]).dot(along) > 0});
      }
    }
  return edges;
}

} // namespace

SharpFeatures find_sharp_features(const topology::SurfaceMesh& mesh, double sharp_degrees) {
  std::vector<SharpEdge> edges = sharp_edges(mesh, sharp_degrees);
  std::map<int, std::vector<int>> at_vertex; // sharp edges of a vertex
  for (int e = 0; e < std::ssize(edges); ++e)
    for (int v : edges[e].vertices)
      at_vertex[v].push_back(e);

  std::map<int, int> component_of; // vertex -> component, by flooding
  SharpFeatures features;
  for (const auto& [first, unused] : at_vertex) {
    if (component_of.contains(first))
      continue;
    std::vector<int> stack{first};
    component_of[first] = features.components;
    while (!stack.empty()) {
      const int v = stack.back();
      stack.pop_back();
      for (int e : at_vertex[v])
        for (int w : edges[e].vertices)
          if (component_of.emplace(w, features.components).second)
            stack.push_back(w);
    }
    ++features.components;
  }

  const auto other_end = [&](int edge, int v) {
    return edges[edge].vertices[0] == v ? edges[edge].vertices[1] : edges[edge].vertices[0];
  };
  const auto is_corner = [&](int v) {
    const std::vector<int>& at = at_vertex.at(v);
    if (at.size() != 2)
      return true;
    const Vector3& x = mesh.vertices[v];
    const Vector3 in = x - mesh.vertices[other_end(at[0], v)], out = mesh.vertices[other_end(at[1], v)] - x;
    return in.dot(out) < 0.5 * in.norm() * out.norm(); // turns by more than 60 degrees
  };
  const auto follow = [&](int vertex, int edge) {
    SharpCurve curve;
    curve.component = component_of.at(vertex);
    curve.vertices.push_back(vertex);
    for (;;) {
      edges[edge].used = true;
      curve.faces.push_back(edges[edge].faces);
      curve.convex.push_back(edges[edge].convex);
      vertex = other_end(edge, vertex);
      curve.vertices.push_back(vertex);
      if (is_corner(vertex))
        return curve;
      const std::vector<int>& at = at_vertex.at(vertex);
      edge = edges[at[0]].used ? at[1] : at[0];
      if (edges[edge].used) { // back where a loop without corners began
        curve.closed = true;
        return curve;
      }
    }
  };
  for (const auto& [v, at] : at_vertex) {
    if (!is_corner(v))
      continue;
    features.corners.push_back(v);
    features.corner_component.push_back(component_of.at(v));
    std::vector<int> triangles;
    for (int e : at)
      triangles.insert(triangles.end(), edges[e].faces.begin(), edges[e].faces.end());
    features.corner_triangles.push_back(std::move(triangles));
    for (int e : at)
      if (!edges[e].used)
        features.curves.push_back(follow(v, e));
  }
  for (const auto& [v, at] : at_vertex)
    for (int e : at)
      if (!edges[e].used)
        features.curves.push_back(follow(v, e));
  return features;
}

} // namespace spherecut::solvers
