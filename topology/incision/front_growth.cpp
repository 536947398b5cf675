#include "topology/incision/front_growth.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <optional>

namespace spherecut::topology {

namespace {

// In units of the edge:
constexpr double still = 0.02, merged = 0.35, stretched = 1.5;
constexpr double reach_out = 0.3;    // of the ends of a front beyond the surface of the body
constexpr double most_sideways = 2;  // in units of its own motion: farther an end is not led outwards in one row
constexpr double least_slope = 0.15; // of the distance to the surface on the way out: less leads nowhere

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
  SheetGrowth(SurfaceMesh& mesh, double edge, const Domain& domain) : mesh_(mesh), edge_(edge), domain_(domain) {}

  /// One row: the ends of `edges` move by `motions`. The moved edges, with their motions, take their place.
  void row(std::vector<BorderEdge>& edges, std::map<int, Vector3>& motions, double share) {
    std::map<int, int> moved; // vertex to its new place; itself where it stays
    for (const auto& [vertex, motion] : motions)
      moved[vertex] = (share * motion).norm() < still * edge_ ? vertex : add(mesh_.vertices[vertex] + share * motion);
    const std::map<int, int> ends = ends_outside(edges);
    for (const auto& [vertex, other] : ends)
      if (const int at = moved.at(vertex); at != vertex)
        mesh_.vertices[at] += way_out(vertex, other, mesh_.vertices[at], share * motions.at(vertex));
    // Neighbours that have come together become one; each vertex in one such pair at most.
    std::map<int, bool> paired;
    for (const BorderEdge& edge : edges) {
      int &a = moved.at(edge.from), &b = moved.at(edge.to);
      if (a == edge.from || b == edge.to || a == b || paired[a] || paired[b] ||
          (mesh_.vertices[a] - mesh_.vertices[b]).norm() >= merged * edge_)
        continue;
      const bool keep_a = ends.contains(edge.from), keep_b = ends.contains(edge.to);
      if (keep_a == keep_b)
        mesh_.vertices[a] = 0.5 * (mesh_.vertices[a] + mesh_.vertices[b]);
      else if (keep_b)
        mesh_.vertices[a] = mesh_.vertices[b];
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
  /// Ends of the front that lie outside the body, with the other end of their edges.
  [[nodiscard]] std::map<int, int> ends_outside(const std::vector<BorderEdge>& edges) const {
    std::map<int, int> uses, ends;
    for (const BorderEdge& edge : edges) {
      ++uses[edge.from];
      ++uses[edge.to];
    }
    const auto add_end = [&](int vertex, int other) {
      if (uses.at(vertex) == 1 && domain_.signed_distance(mesh_.vertices[vertex]) >= 0)
        ends.emplace(vertex, other);
    };
    for (const BorderEdge& edge : edges) {
      add_end(edge.from, edge.to);
      add_end(edge.to, edge.from);
    }
    return ends;
  }

  /// A front that turns inwards, or a surface that opens ahead, would let an end sink into the body, and a ligament
  /// stay along the surface: so far the end, moved to x, has to go on along the front, or else straight out, in the
  /// plane of the growth.
  [[nodiscard]] Vector3 way_out(int vertex, int other, const Vector3& x, const Vector3& motion) const {
    const Vector3 along = (mesh_.vertices[vertex] - mesh_.vertices[other]).normalized(), across = along.cross(motion);
    if (!(across.norm() > 0))
      return Vector3::Zero();
    const Vector3 normal = across.normalized();
    const double most = most_sideways * motion.norm();
    Vector3 way = Vector3::Zero();
    for (int correction = 0; correction < 3; ++correction) {
      const double missing = reach_out * edge_ - domain_.signed_distance(x + way);
      if (missing <= 0)
        break;
      const Vector3 outward = domain_.normal(x + way), in_plane = outward - outward.dot(normal) * normal;
      const Vector3 direction = along.dot(outward) > least_slope ? along : in_plane.normalized();
      if (!(direction.dot(outward) > least_slope))
        break;
      way += std::min(missing / direction.dot(outward), most - way.norm()) * direction;
    }
    return way;
  }

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
  const Domain& domain_;
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
    SheetGrowth sheet(mesh, edge, *incision.domain());
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
