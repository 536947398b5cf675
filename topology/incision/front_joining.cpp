#include "topology/incision/front_joining.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <fmt/format.h>
#include <map>

namespace spherecut::topology {

namespace {

constexpr double in_front = 0.5;     // cosine between the way of an edge and what faces it
constexpr double oncoming = -0.5;    // cosine between the ways of two edges that face each other
constexpr double clear_share = 0.02; // of the gap, left out at its ends when it is looked through

/// An edge of the front with the way in which it would grow.
struct FrontEdge {
  int sheet;
  BorderEdge edge;
  Vector3 from, to, middle, ahead;
};

Vector3 nearest_on(const FrontEdge& edge, const Vector3& x) {
  const Vector3 along = edge.to - edge.from;
  return edge.from + std::clamp((x - edge.from).dot(along) / along.squaredNorm(), 0.0, 1.0) * along;
}

std::vector<FrontEdge> all_edges(const Incision& incision) {
  std::vector<FrontEdge> all;
  for (int s = 0; s < std::ssize(incision.sheets()); ++s) {
    const SurfaceMesh& mesh = incision.sheets()[static_cast<std::size_t>(s)];
    std::map<std::pair<int, int>, std::size_t> triangle_of;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      for (int e = 0; e < 3; ++e)
        triangle_of[{mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3]}] = t;
    for (const BorderEdge& edge : front_edges(incision, s)) {
      const auto& [a, b, c] = mesh.triangles[triangle_of.at({edge.from, edge.to})];
      const Vector3 normal = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
      const Vector3 &from = mesh.vertices[edge.from], &to = mesh.vertices[edge.to];
      all.push_back({s, edge, from, to, 0.5 * (from + to), (to - from).cross(normal).normalized()});
    }
  }
  return all;
}

/// Index of the edge that each one faces, -1: none.
std::vector<int> partners(const Incision& incision, const std::vector<FrontEdge>& edges, double reach) {
  if (!(reach > 0) || !std::isfinite(reach))
    throw InputError(fmt::format("fronts that face each other within {} m: that must be positive", reach));
  std::vector<int> facing(edges.size(), -1);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    double nearest = reach;
    for (std::size_t j = 0; j < edges.size(); ++j) {
      if (i == j || edges[i].ahead.dot(edges[j].ahead) > oncoming)
        continue;
      const Vector3 across = nearest_on(edges[j], edges[i].middle) - edges[i].middle;
      const double gap = across.norm();
      if (gap > nearest || across.dot(edges[i].ahead) < in_front * gap)
        continue;
      const Vector3 end = clear_share * across;
      if (incision.blocks(edges[i].middle + end, edges[i].middle + across - end))
        continue;
      nearest = gap;
      facing[i] = static_cast<int>(j);
    }
  }
  return facing;
}

/// Edges that follow one another, of one sheet, all facing one other sheet.
struct Run {
  int sheet = -1, other = -1;
  std::vector<std::size_t> edges;
};

std::vector<Run> runs_of(const std::vector<FrontEdge>& edges, const std::vector<int>& facing) {
  std::map<std::pair<int, int>, std::size_t> leaving, arriving; // sheet and vertex to edge
  for (std::size_t i = 0; i < edges.size(); ++i) {
    leaving[{edges[i].sheet, edges[i].edge.from}] = i;
    arriving[{edges[i].sheet, edges[i].edge.to}] = i;
  }
  const auto other = [&](std::size_t i) { return edges[static_cast<std::size_t>(facing[i])].sheet; };
  std::vector<char> taken(edges.size(), 0);
  std::vector<Run> runs;
  for (std::size_t start = 0; start < edges.size(); ++start) {
    if (taken[start] != 0 || facing[start] < 0)
      continue;
    Run run{edges[start].sheet, other(start), {}};
    const auto belongs = [&](std::size_t i) {
      return taken[i] == 0 && facing[i] >= 0 && edges[i].sheet == run.sheet && other(i) == run.other;
    };
    std::deque<std::size_t> chain{start};
    taken[start] = 1;
    for (auto next = leaving.find({run.sheet, edges[start].edge.to});;
         chain.push_back(next->second), next = leaving.find({run.sheet, edges[chain.back()].edge.to})) {
      if (next == leaving.end() || !belongs(next->second))
        break;
      taken[next->second] = 1;
    }
    for (auto next = arriving.find({run.sheet, edges[start].edge.from});;
         chain.push_front(next->second), next = arriving.find({run.sheet, edges[chain.front()].edge.from})) {
      if (next == arriving.end() || !belongs(next->second))
        break;
      taken[next->second] = 1;
    }
    run.edges.assign(chain.begin(), chain.end());
    runs.push_back(std::move(run));
  }
  return runs;
}

std::vector<int> vertices_of(const Run& run, const std::vector<FrontEdge>& edges) {
  std::vector<int> vertices{edges[run.edges.front()].edge.from};
  for (const std::size_t i : run.edges)
    vertices.push_back(edges[i].edge.to);
  return vertices;
}

/// Triangles between the border a (in its own direction) and b, whose vertices run along it.
std::vector<Triangle> strip(const SurfaceMesh& mesh, const std::vector<int>& a, const std::vector<int>& b) {
  const auto& x = mesh.vertices;
  std::vector<Triangle> triangles;
  std::size_t i = 0, j = 0;
  while (i + 1 < a.size() || j + 1 < b.size()) {
    const bool along_a = j + 1 == b.size() || (i + 1 < a.size() && (x[a[i + 1]] - x[b[j]]).squaredNorm() <=
                                                                       (x[a[i]] - x[b[j + 1]]).squaredNorm());
    triangles.push_back(along_a ? Triangle{a[i + 1], a[i], b[j]} : Triangle{a[i], b[j], b[j + 1]});
    ++(along_a ? i : j);
  }
  return triangles;
}

} // namespace

std::vector<FacingFronts> facing_fronts(const Incision& incision, double reach) {
  const std::vector<FrontEdge> edges = all_edges(incision);
  const std::vector<int> facing = partners(incision, edges, reach);
  std::vector<FacingFronts> pairs;
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (facing[i] >= 0) {
      const FrontEdge& other = edges[static_cast<std::size_t>(facing[i])];
      pairs.push_back({edges[i].sheet, edges[i].edge.from, edges[i].edge.to, other.sheet, other.edge.from,
                       other.edge.to, edges[i].middle, nearest_on(other, edges[i].middle) - edges[i].middle});
    }
  return pairs;
}

FrontGrowth join_fronts(const Incision& incision, double reach) {
  FrontGrowth growth;
  growth.sheets = incision.sheets();
  const std::vector<FrontEdge> edges = all_edges(incision);
  const std::vector<int> facing = partners(incision, edges, reach);
  const std::vector<Run> runs = runs_of(edges, facing);
  std::vector<char> used(runs.size(), 0);
  std::vector<std::size_t> run_of(edges.size(), runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (const std::size_t i : runs[r].edges)
      run_of[i] = r;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (used[r] != 0)
      continue;
    std::map<std::size_t, int> votes; // of runs that are faced
    for (const std::size_t i : runs[r].edges)
      if (const std::size_t q = run_of[static_cast<std::size_t>(facing[i])]; q < runs.size() && q != r && used[q] == 0)
        ++votes[q];
    if (votes.empty())
      continue;
    const std::size_t q = std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) {
                            return a.second < b.second;
                          })->first;
    used[r] = used[q] = 1;
    const Run &one = runs[r], &other = runs[q];
    SurfaceMesh& mesh = growth.sheets[static_cast<std::size_t>(one.sheet)];
    const SurfaceMesh& opposite = incision.sheets()[static_cast<std::size_t>(other.sheet)];
    const std::vector<int> a = vertices_of(one, edges);
    std::vector<int> b = vertices_of(other, edges);
    const Vector3 way = mesh.vertices[a.back()] - mesh.vertices[a.front()];
    const bool reversed = way.dot(opposite.vertices[b.back()] - opposite.vertices[b.front()]) < 0;
    if (reversed)
      std::reverse(b.begin(), b.end());
    if (one.sheet == other.sheet && !reversed)
      continue; // it would be glued to itself the wrong way round
    if (one.sheet != other.sheet)
      for (int& vertex : b) {
        mesh.vertices.push_back(opposite.vertices[vertex]);
        vertex = static_cast<int>(mesh.vertices.size()) - 1;
      }
    const std::vector<Triangle> added = strip(mesh, a, b);
    for (const auto& [u, v, w] : added)
      growth.area += 0.5 * (mesh.vertices[v] - mesh.vertices[u]).cross(mesh.vertices[w] - mesh.vertices[u]).norm();
    growth.triangles += static_cast<int>(added.size());
    mesh.triangles.insert(mesh.triangles.end(), added.begin(), added.end());
  }
  return growth;
}

} // namespace spherecut::topology
