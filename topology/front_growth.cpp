#include "topology/front_growth.hpp"

#include "topology/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <optional>

namespace spherecut::topology {

namespace {

constexpr double still = 0.02, merged = 0.35, stretched = 1.5; // in units of the edge

} // namespace

std::vector<BorderEdge> front_edges(const Incision& incision, int sheet) {
  const SurfaceMesh& mesh = incision.sheets()[sheet];
  const auto neighbours = triangle_neighbours(mesh);
  const double tolerance = 1e-6 * incision.domain()->bounds().extent().norm();
  constexpr int samples = 8;
  std::vector<BorderEdge> edges;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e) {
      if (neighbours[t][e] >= 0)
        continue;
      const int a = mesh.triangles[t][e], b = mesh.triangles[t][(e + 1) % 3];
      bool is_front = false;
      for (int k = 0; k <= samples && !is_front; ++k) {
        const Vector3 x = mesh.vertices[a] + static_cast<double>(k) / samples * (mesh.vertices[b] - mesh.vertices[a]);
        const auto frame = incision.front_frame(x, tolerance);
        is_front = frame && incision.front()[frame->segment].sheet == sheet;
      }
      if (is_front)
        edges.push_back({a, b});
    }
  return edges;
}

namespace {

/// Grows one sheet; its border edges and the motions of their ends change row by row.
class SheetGrowth {
 public:
  SheetGrowth(SurfaceMesh& mesh, double edge) : mesh_(mesh), edge_(edge) {}

  /// One row: the ends of `edges` move by `motions`. The moved edges, with their motions, take their place.
  void row(std::vector<BorderEdge>& edges, std::map<int, Vector3>& motions, double share) {
    std::map<int, int> moved; // vertex to its new place; itself where it stays
    for (const auto& [vertex, motion] : motions)
      moved[vertex] = (share * motion).norm() < still * edge_ ? vertex : add(mesh_.vertices[vertex] + share * motion);
    // Neighbours that have come together become one; each vertex in one such pair at most.
    std::map<int, bool> paired;
    for (const BorderEdge& edge : edges) {
      int &a = moved.at(edge.from), &b = moved.at(edge.to);
      if (a == edge.from || b == edge.to || a == b || paired[a] || paired[b] ||
          (mesh_.vertices[a] - mesh_.vertices[b]).norm() >= merged * edge_)
        continue;
      mesh_.vertices[a] = 0.5 * (mesh_.vertices[a] + mesh_.vertices[b]);
      b = a;
      paired[a] = true;
    }
    std::vector<BorderEdge> next;
    std::map<int, Vector3> next_motions;
    for (const BorderEdge& edge : edges) {
      const int a = edge.from, b = edge.to, c = moved.at(a), d = moved.at(b);
      const Vector3 &at_a = motions.at(a), &at_b = motions.at(b);
      if (c != a || d != b)
        fill(a, b, c, d, 0.5 * (at_a + at_b), next, next_motions);
      else
        next.push_back(edge);
      next_motions.emplace(c, at_a);
      next_motions.emplace(d, at_b);
    }
    edges = std::move(next);
    motions = std::move(next_motions);
  }

 private:
  int add(const Vector3& x) {
    mesh_.vertices.push_back(x);
    return static_cast<int>(mesh_.vertices.size()) - 1;
  }

  void add_triangle(int a, int b, int c) {
    const auto& x = mesh_.vertices;
    const double longest = std::max({(x[a] - x[b]).norm(), (x[b] - x[c]).norm(), (x[c] - x[a]).norm()});
    if (a != b && b != c && c != a && (x[b] - x[a]).cross(x[c] - x[a]).norm() > 1e-5 * longest * longest)
      mesh_.triangles.push_back({a, b, c});
  }

  /// The strip between the border edge a b and its new place c d.
  void fill(int a, int b, int c, int d, const Vector3& motion, std::vector<BorderEdge>& next,
            std::map<int, Vector3>& next_motions) {
    const auto& x = mesh_.vertices;
    if (c == d) { // the new edge has shrunk to a point
      add_triangle(b, a, c);
      return;
    }
    if (c != a && d != b && (x[c] - x[d]).norm() > stretched * edge_) {
      const int m = add(0.5 * (x[c] + x[d]));
      add_triangle(a, c, m);
      add_triangle(b, a, m);
      add_triangle(b, m, d);
      next.push_back({c, m});
      next.push_back({m, d});
      next_motions.emplace(m, motion);
      return;
    }
    if (c == a) {
      add_triangle(b, a, d);
    } else if (d == b) {
      add_triangle(b, a, c);
    } else if ((x[a] - x[d]).squaredNorm() < (x[b] - x[c]).squaredNorm()) {
      add_triangle(b, a, d);
      add_triangle(a, c, d);
    } else {
      add_triangle(b, a, c);
      add_triangle(b, c, d);
    }
    next.push_back({c, d});
  }

  SurfaceMesh& mesh_;
  double edge_;
};

} // namespace

FrontGrowth grow_front(const Incision& incision, const std::function<Vector3(const FrontFrame&)>& motion, double edge) {
  if (!(edge > 0) || !std::isfinite(edge))
    throw InputError(fmt::format("growth of a front: edges of {} m; they must be positive", edge));
  FrontGrowth growth;
  growth.sheets = incision.sheets();
  for (int s = 0; s < std::ssize(growth.sheets); ++s) {
    std::vector<BorderEdge> edges = front_edges(incision, s);
    SurfaceMesh& mesh = growth.sheets[s];
    std::map<int, Vector3> motions;
    double longest = 0;
    for (const BorderEdge& one : edges)
      for (const int vertex : {one.from, one.to}) {
        if (motions.contains(vertex))
          continue;
        const double reach = 2 * edge + (mesh.vertices[one.from] - mesh.vertices[one.to]).norm();
        const auto frame = incision.front_frame(mesh.vertices[vertex], reach);
        const Vector3 step = frame ? motion(*frame) : Vector3(Vector3::Zero());
        if (!step.allFinite())
          throw InputError(fmt::format("growth of a front: the motion at ({:.6g}, {:.6g}, {:.6g}) m is not finite",
                                       mesh.vertices[vertex].x(), mesh.vertices[vertex].y(),
                                       mesh.vertices[vertex].z()));
        motions.emplace(vertex, step);
        longest = std::max(longest, step.norm());
      }
    if (longest < still * edge)
      continue;
    const std::size_t before = mesh.triangles.size();
    const int rows = std::max(1, static_cast<int>(std::ceil(longest / edge - 1e-9)));
    SheetGrowth sheet(mesh, edge);
    for (int row = 0; row < rows; ++row)
      sheet.row(edges, motions, 1.0 / rows);
    growth.triangles += static_cast<int>(mesh.triangles.size() - before);
    for (std::size_t t = before; t < mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      growth.area += 0.5 * (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]).norm();
    }
  }
  return growth;
}

} // namespace spherecut::topology
