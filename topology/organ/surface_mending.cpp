#include "topology/organ/surface_mending.hpp"

#include "topology/surface/self_intersections.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr double sliver_ratio = 1e-3;

double triangle_area(const Vector3& a, const Vector3& b, const Vector3& c) {
  return 0.5 * (b - a).cross(c - a).norm();
}

/// Which edge of the triangle is the longest and which the shortest; edge e joins corners e and e + 1.
struct Shape {
  int longest = 0, shortest = 0;
  double longest_length = 0, shortest_length = std::numeric_limits<double>::infinity(); // m
  double height = 0;                                                                    // m, over the longest edge
};

Shape shape_of(const SurfaceMesh& mesh, const Triangle& t) {
  Shape shape;
  for (int e = 0; e < 3; ++e) {
    const double length = (mesh.vertices[t[e]] - mesh.vertices[t[(e + 1) % 3]]).norm();
    if (length > shape.longest_length) {
      shape.longest_length = length;
      shape.longest = e;
    }
    if (length < shape.shortest_length) {
      shape.shortest_length = length;
      shape.shortest = e;
    }
  }
  if (shape.longest_length > 0)
    shape.height =
        2 * triangle_area(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]) / shape.longest_length;
  return shape;
}

bool sliver(const Shape& shape) {
  return shape.height < sliver_ratio * shape.longest_length;
}

/// The surface with the triangles around each vertex, for a few local changes at a time.
class LocalEdits {
 public:
  explicit LocalEdits(SurfaceMesh& mesh)
      : mesh_(mesh), around_(mesh.vertices.size()), alive_(mesh.triangles.size(), true) {
    for (int t = 0; t < std::ssize(mesh.triangles); ++t)
      for (const int v : mesh.triangles[t])
        around_[v].push_back(t);
  }

  [[nodiscard]] bool alive(int t) const { return alive_[t]; }

  /// Merges the two ends of edge e of triangle t, when the edge's ends share exactly the two neighbours across it.
  bool collapse(int t, int e) {
    const int keep = std::min(mesh_.triangles[t][e], mesh_.triangles[t][(e + 1) % 3]);
    const int drop = std::max(mesh_.triangles[t][e], mesh_.triangles[t][(e + 1) % 3]);
    const std::vector<int> keep_ring = ring(keep), drop_ring = ring(drop);
    std::vector<int> shared;
    std::set_intersection(keep_ring.begin(), keep_ring.end(), drop_ring.begin(), drop_ring.end(),
                          std::back_inserter(shared));
    if (shared.size() != 2 || keep_ring.size() + drop_ring.size() < 8)
      return false;
    if (keep_ring.size() != around_[keep].size() && drop_ring.size() != around_[drop].size())
      return false; // both on a border: a sheet would be pinched there
    for (const int other : shared)
      if (around_[other].size() <= 3)
        return false;
    const std::vector<int> moved = around_[drop];
    for (const int triangle : moved) {
      Triangle& corners = mesh_.triangles[triangle];
      if (std::find(corners.begin(), corners.end(), keep) != corners.end()) {
        remove(triangle);
        continue;
      }
      std::replace(corners.begin(), corners.end(), drop, keep);
      around_[keep].push_back(triangle);
    }
    around_[drop].clear();
    return true;
  }

  /// Turns edge e of triangle t to join the two opposite corners, unless they are joined already or the new triangles
  /// would fold over or be slivers themselves.
  bool flip(int t, int e) {
    const Triangle corners = mesh_.triangles[t];
    const int a = corners[e], b = corners[(e + 1) % 3], apex = corners[(e + 2) % 3];
    const int neighbour = across(t, a, b);
    if (neighbour < 0)
      return false;
    int opposite = -1;
    for (const int v : mesh_.triangles[neighbour])
      if (v != a && v != b)
        opposite = v;
    const std::vector<int> apex_ring = ring(apex);
    if (std::binary_search(apex_ring.begin(), apex_ring.end(), opposite) || around_[a].size() <= 3 ||
        around_[b].size() <= 3)
      return false;
    const Triangle first = {apex, a, opposite}, second = {apex, opposite, b};
    const Vector3 before = area_vector(mesh_.triangles[neighbour]);
    if (area_vector(first).dot(before) <= 0 || area_vector(second).dot(before) <= 0)
      return false;
    mesh_.triangles[t] = first;
    mesh_.triangles[neighbour] = second;
    std::erase(around_[b], t);
    std::erase(around_[a], neighbour);
    around_[opposite].push_back(t);
    around_[apex].push_back(neighbour);
    return true;
  }

  void compact(std::vector<int>& labels) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
      if (alive_[t]) {
        labels[kept] = labels[t];
        mesh_.triangles[kept++] = mesh_.triangles[t];
      }
    labels.resize(kept);
    mesh_.triangles.resize(kept);
  }

 private:
  [[nodiscard]] Vector3 area_vector(const Triangle& t) const {
    const Vector3& a = mesh_.vertices[t[0]];
    return (mesh_.vertices[t[1]] - a).cross(mesh_.vertices[t[2]] - a);
  }

  /// Vertices joined to v by an edge, ascending.
  [[nodiscard]] std::vector<int> ring(int v) const {
    std::vector<int> vertices;
    for (const int t : around_[v])
      for (const int other : mesh_.triangles[t])
        if (other != v)
          vertices.push_back(other);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
  }

  [[nodiscard]] int across(int t, int a, int b) const {
    for (const int other : around_[a])
      if (other != t && std::find(around_[b].begin(), around_[b].end(), other) != around_[b].end())
        return other;
    return -1;
  }

  void remove(int t) {
    alive_[t] = false;
    for (const int v : mesh_.triangles[t])
      std::erase(around_[v], t);
  }

  SurfaceMesh& mesh_;
  std::vector<std::vector<int>> around_;
  std::vector<bool> alive_;
};

} // namespace

std::vector<int> coinciding_vertices(const std::vector<Vector3>& vertices, double tolerance) {
  // Cells far larger than the tolerance: nearly every vertex looks into one cell alone.
  const double cell = 1000 * tolerance;
  const auto cell_of = [cell](double x) { return static_cast<std::int64_t>(std::floor(x / cell)); };
  const auto key = [](std::int64_t i, std::int64_t j, std::int64_t k) {
    return static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL ^
           static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL ^
           static_cast<std::uint64_t>(k) * 0x165667B19E3779F9ULL;
  };
  std::unordered_map<std::uint64_t, std::vector<int>> firsts;
  firsts.reserve(vertices.size());
  std::vector<int> first(vertices.size());
  for (int v = 0; v < std::ssize(vertices); ++v) {
    const Vector3& x = vertices[v];
    first[v] = v;
    for (std::int64_t i = cell_of(x.x() - tolerance); i <= cell_of(x.x() + tolerance); ++i)
      for (std::int64_t j = cell_of(x.y() - tolerance); j <= cell_of(x.y() + tolerance); ++j)
        for (std::int64_t k = cell_of(x.z() - tolerance); k <= cell_of(x.z() + tolerance); ++k)
          if (const auto found = firsts.find(key(i, j, k)); found != firsts.end())
            for (const int other : found->second)
              if ((vertices[other] - x).norm() <= tolerance)
                first[v] = std::min(first[v], other);
    if (first[v] == v)
      firsts[key(cell_of(x.x()), cell_of(x.y()), cell_of(x.z()))].push_back(v);
  }
  return first;
}

std::vector<Triangle> triangulate_polygon(const std::vector<Vector3>& corners) {
  const int n = static_cast<int>(corners.size());
  struct Choice {
    double cost = 0;
    int apex = -1;
  };
  // best[i][j]: the cheapest triangulation of corners i to j, whose last side is the diagonal j to i.
  std::vector<std::vector<Choice>> best(n, std::vector<Choice>(n));
  for (int span = 2; span < n; ++span)
    for (int i = 0; i + span < n; ++i) {
      const int j = i + span;
      Choice& choice = best[i][j];
      choice.cost = std::numeric_limits<double>::infinity();
      for (int k = i + 1; k < j; ++k) {
        constexpr double shortness = 1e-4;
        const double cost = best[i][k].cost + best[k][j].cost + triangle_area(corners[i], corners[k], corners[j]) +
                            shortness * (corners[i] - corners[j]).squaredNorm();
        if (cost < choice.cost)
          choice = {cost, k};
      }
    }
  std::vector<Triangle> triangles;
  std::vector<std::pair<int, int>> open = {{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2)
      continue;
    const int k = best[i][j].apex;
    triangles.push_back({i, k, j});
    open.emplace_back(i, k);
    open.emplace_back(k, j);
  }
  return triangles;
}

std::vector<std::vector<int>> border_loops(const SurfaceMesh& mesh) {
  const auto neighbours = triangle_neighbours(mesh);
  std::map<int, int> next; // against the direction of the triangles: a fill shares the edges the other way
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0)
        next[mesh.triangles[t][(e + 1) % 3]] = mesh.triangles[t][e];
  std::vector<std::vector<int>> loops;
  while (!next.empty()) {
    std::vector<int> loop;
    for (auto at = next.begin(); at != next.end();) {
      loop.push_back(at->first);
      const int following = at->second;
      next.erase(at);
      at = next.find(following);
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

bool is_sliver(const SurfaceMesh& mesh, const Triangle& triangle) {
  return sliver(shape_of(mesh, triangle));
}

int remove_slivers(SurfaceMesh& mesh, std::vector<int>& labels) {
  constexpr double short_edge = 0.01; // of the longest: collapsing it moves the surface by no more than that
  int operations = 0;
  LocalEdits edits(mesh);
  constexpr int most_passes = 10;
  for (int pass = 0; pass < most_passes; ++pass) {
    int changed = 0;
    for (int t = 0; t < std::ssize(mesh.triangles); ++t) {
      if (!edits.alive(t))
        continue;
      const Shape shape = shape_of(mesh, mesh.triangles[t]);
      if (!sliver(shape))
        continue;
      const bool needle = shape.shortest_length < short_edge * shape.longest_length;
      changed += (needle && edits.collapse(t, shape.shortest)) || edits.flip(t, shape.longest);
    }
    operations += changed;
    if (changed == 0)
      break;
  }
  edits.compact(labels);
  return operations;
}

std::optional<Smoothing> smooth_apart(SurfaceMesh& mesh, double most_movement) {
  constexpr int most_rounds = 20;
  constexpr double step = 0.1;
  std::map<int, Vector3> original; // of the vertices moved so far
  for (int round = 0; round <= most_rounds; ++round) {
    std::vector<bool> passing(mesh.vertices.size(), false);
    const auto pairs = self_intersections(mesh);
    if (pairs.empty()) {
      Smoothing result{static_cast<int>(original.size()), 0};
      for (const auto& [v, start] : original)
        result.movement = std::max(result.movement, (mesh.vertices[v] - start).norm());
      if (result.movement <= most_movement)
        return result;
      break;
    }
    for (const auto& [a, b] : pairs)
      for (const int t : {a, b})
        for (const int v : mesh.triangles[t])
          passing[v] = true;
    // On a closed surface every neighbour follows the vertex in exactly one triangle.
    std::vector<Vector3> sum(mesh.vertices.size(), Vector3::Zero());
    std::vector<int> neighbours(mesh.vertices.size(), 0);
    for (const Triangle& t : mesh.triangles)
      for (int e = 0; e < 3; ++e) {
        sum[t[e]] += mesh.vertices[t[(e + 1) % 3]];
        ++neighbours[t[e]];
      }
    for (int v = 0; v < std::ssize(mesh.vertices); ++v)
      if (passing[v]) {
        original.emplace(v, mesh.vertices[v]);
        mesh.vertices[v] += step * (sum[v] / neighbours[v] - mesh.vertices[v]);
      }
  }
  for (const auto& [v, start] : original)
    mesh.vertices[v] = start;
  return std::nullopt;
}

int remove_unused_vertices(SurfaceMesh& mesh) {
  std::vector<int> place(mesh.vertices.size(), -1);
  for (const Triangle& t : mesh.triangles)
    for (const int v : t)
      place[v] = 0;
  int kept = 0;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (place[v] == 0) {
      place[v] = kept;
      mesh.vertices[kept++] = mesh.vertices[v];
    }
  const int removed = static_cast<int>(mesh.vertices.size()) - kept;
  mesh.vertices.resize(kept);
  for (Triangle& t : mesh.triangles)
    for (int& v : t)
      v = place[v];
  return removed;
}

} // namespace spherecut::topology
