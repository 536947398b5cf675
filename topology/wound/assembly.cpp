#include "topology/wound/assembly.hpp"

#include "topology/base/errors.hpp"
#include "topology/surface/triangle_corners.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::topology {

namespace {

double angle_between(const Vector3& a, const Vector3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

} // namespace

std::uint64_t WoundAssembly::key_of(int u, int v) {
  const auto [low, high] = std::minmax(u, v);
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(low)) << 32) | static_cast<std::uint32_t>(high);
}

WoundAssembly::WoundAssembly(const SurfaceMesh& organ, const WoundOptions& options)
    : arrangement_(organ), options_(options), centre_(bounds(organ).centre()),
      organ_triangles_(static_cast<int>(organ.triangles.size())) {
  // One vertex and one triangle per vertex and triangle of the organ, under the same numbers.
  const std::size_t triangles = organ.triangles.size(), vertices = organ.vertices.size();
  if (arrangement_.point_count() != static_cast<int>(vertices))
    throw InputError(fmt::format("organ: {} of its {} vertices lie at the place of another",
                                 static_cast<int>(vertices) - arrangement_.point_count(), vertices));
  wound_.surface = organ;
  wound_.part.assign(triangles, WoundPart::organ);
  wound_.sheet.assign(triangles, -1);
  wound_.source_triangle.resize(triangles);
  std::iota(wound_.source_triangle.begin(), wound_.source_triangle.end(), 0);
  wound_.component.assign(triangles, -1);
  wound_.point.resize(vertices);
  std::iota(wound_.point.begin(), wound_.point.end(), 0);
  wound_.evaluation = organ.vertices;
  owner_ = wound_.point;
  copies_.resize(vertices);
  for (int v = 0; v < std::ssize(organ.vertices); ++v)
    copies_[v] = {v};
  corner_.resize(2 * triangles);
  across_.resize(2 * triangles);
  output_.resize(2 * triangles);
  half_of_.resize(triangles);
  const auto neighbours = triangle_neighbours(organ);
  for (std::size_t t = 0; t < triangles; ++t) {
    corner_[2 * t] = organ.triangles[t];
    for (int e = 0; e < 3; ++e)
      across_[2 * t][e] = 2 * neighbours[t][e];
    output_[2 * t].triangles[0] = static_cast<int>(t);
    half_of_[t] = static_cast<int>(2 * t);
  }
  vertex_component_.assign(vertices, -1);
  label_all();
}

IncrementalWound::Growth WoundAssembly::add(const std::vector<std::array<Vector3, 3>>& triangles,
                                            const std::vector<int>& sheet_of, const std::vector<int>& triangle_of) {
  for (std::size_t k = 0; k < triangles.size(); ++k)
    sheet_source_.emplace_back(sheet_of[k], triangle_of[k]);
  const ExactArrangement::Change change = arrangement_.add(triangles);
  IncrementalWound::Growth growth{change.crossed, 0};
  if (change.removed.empty() && change.added.empty())
    return growth;
  const std::size_t halves = 2 * static_cast<std::size_t>(arrangement_.facet_count());
  corner_.resize(halves);
  across_.resize(halves);
  output_.resize(halves);
  copies_.resize(arrangement_.point_count());
  Region region = region_of(change);
  growth.rebuilt = remove_outputs(change, region);
  pair_halves(region);
  make_copies(region);
  split_edges(region);
  emit(region);
  compact();
  update_components(region);
  return growth;
}

WoundAssembly::Region WoundAssembly::region_of(const ExactArrangement::Change& change) const {
  Region region;
  for (const std::vector<int>* facets : {&change.removed, &change.added})
    for (const int f : *facets)
      for (const int p : arrangement_.facet(f).points)
        region.points.push_back(p);
  keep_once(region.points);
  for (const int p : region.points)
    arrangement_.facets_at(p, region.facets);
  keep_once(region.facets);
  const auto changed = [&](int p) { return std::binary_search(region.points.begin(), region.points.end(), p); };
  for (const int f : region.facets) {
    const Triangle& t = arrangement_.facet(f).points;
    for (int e = 0; e < 3; ++e)
      if (changed(t[e]) || changed(t[(e + 1) % 3]))
        region.edges.emplace_back(std::minmax(t[e], t[(e + 1) % 3]));
  }
  std::sort(region.edges.begin(), region.edges.end());
  region.edges.erase(std::unique(region.edges.begin(), region.edges.end()), region.edges.end());
  region.wedges.resize(region.edges.size());
  return region;
}

int WoundAssembly::remove_outputs(const ExactArrangement::Change& change, const Region& region) {
  int removed = 0;
  std::vector<int> facets = change.removed;
  facets.insert(facets.end(), region.facets.begin(), region.facets.end());
  for (const int half : halves_of(facets)) {
    Output& output = output_[half];
    for (int& t : output.triangles)
      if (t >= 0) {
        drop_triangle(t);
        t = -1;
        ++removed;
      }
    output.component = -1;
    if (const auto centre = centres_.find(half); centre != centres_.end()) {
      drop_vertex(centre->second);
      centres_.erase(centre);
    }
  }
  for (const int f : change.removed) {
    const Triangle& t = arrangement_.facet(f).points;
    for (int e = 0; e < 3; ++e)
      drop_middles(t[e], t[(e + 1) % 3]);
  }
  for (const auto& [u, v] : region.edges)
    drop_middles(u, v);
  for (const int p : region.points) {
    for (const int vertex : copies_[p])
      drop_vertex(vertex);
    copies_[p].clear();
  }
  return removed;
}

int WoundAssembly::half_running(int facet, int from, int to) const {
  if (runs(arrangement_.facet(facet).points, from, to))
    return 2 * facet;
  return arrangement_.on_surface(facet) ? -1 : 2 * facet + 1;
}

void WoundAssembly::pair_halves(Region& region) {
  std::vector<int> facets;
  for (std::size_t k = 0; k < region.edges.size(); ++k) {
    const int u = region.edges[k].first, v = region.edges[k].second;
    facets.clear();
    arrangement_.facets_at_edge(u, v, facets);
    arrangement_.sort_about_edge(u, v, facets);
    // Counter-clockwise about u -> v: the wedge after a facet is bounded by its half that runs from v to u, and by the
    // half of the next facet that runs from u to v. Outside the solid neither exists.
    for (std::size_t i = 0; i < facets.size(); ++i) {
      const int first = facets[i], second = facets[(i + 1) % facets.size()];
      const int a = half_running(first, v, u), b = half_running(second, u, v);
      if (a < 0 && b < 0)
        continue;
      if (a < 0 || b < 0)
        throw NumericalError(fmt::format("the organ's surface passes through itself near ({:.6g}, {:.6g}, {:.6g}) m",
                                         arrangement_.position(u).x(), arrangement_.position(u).y(),
                                         arrangement_.position(u).z()));
      const auto edge_of = [&](int facet) {
        const Triangle& t = arrangement_.facet(facet).points;
        return corner_at(t, runs(t, u, v) ? u : v);
      };
      across_[a][edge_of(first)] = b;
      across_[b][edge_of(second)] = a;
      region.wedges[k].push_back({a, b});
    }
  }
}

void WoundAssembly::make_copies(const Region& region) {
  std::vector<int> facets, group;
  for (const int p : region.points) {
    facets.clear();
    arrangement_.facets_at(p, facets);
    const std::vector<int> halves = halves_of(facets);
    group.resize(halves.size());
    std::iota(group.begin(), group.end(), 0);
    const auto root = [&](int i) {
      while (group[i] != i)
        i = group[i] = group[group[i]];
      return i;
    };
    for (int i = 0; i < std::ssize(halves); ++i) {
      const int c = corner_at(arrangement_.facet(halves[i] / 2).points, p);
      for (const int e : {c, (c + 2) % 3}) {
        const auto other = std::lower_bound(halves.begin(), halves.end(), across_[halves[i]][e]);
        const int a = root(i), b = root(static_cast<int>(other - halves.begin()));
        group[std::max(a, b)] = std::min(a, b);
      }
    }
    for (int i = 0; i < std::ssize(halves); ++i) {
      if (root(i) != i)
        continue;
      const int vertex = new_vertex(arrangement_.position(p), p, p);
      copies_[p].push_back(vertex);
      // Angle-weighted normals of the walls alone point into them [Baerentzen and Aanaes 2005].
      Vector3 normals = Vector3::Zero();
      double weight = 0, length = 0;
      for (int j = i; j < std::ssize(halves); ++j) {
        if (root(j) != i)
          continue;
        const Triangle& t = arrangement_.facet(halves[j] / 2).points;
        const int c = corner_at(t, p);
        corner_[halves[j]][c] = vertex;
        if (arrangement_.on_surface(halves[j] / 2))
          continue;
        const Vector3 a = arrangement_.position(t[(c + 1) % 3]) - arrangement_.position(p);
        const Vector3 b = arrangement_.position(t[(c + 2) % 3]) - arrangement_.position(p);
        const double angle = angle_between(a, b);
        normals += angle * outward(halves[j]);
        weight += angle;
        length = std::max({length, a.norm(), b.norm()});
      }
      wound_.evaluation[vertex] += offset(normals, weight, length);
    }
  }
}

Vector3 WoundAssembly::offset(const Vector3& normals, double weight, double length) const {
  constexpr double cancelled = 1e-9; // walls that face each other across the front
  if (!(normals.norm() > cancelled * weight))
    return Vector3::Zero();
  constexpr double relative_offset = 1e-4;
  const double distance = options_.evaluation_offset > 0 ? options_.evaluation_offset : relative_offset * length;
  return -distance * normals.normalized();
}

void WoundAssembly::split_edges(const Region& region) {
  for (std::size_t k = 0; k < region.edges.size(); ++k) {
    const auto& [u, v] = region.edges[k];
    const auto& wedges = region.wedges[k];
    if (wedges.size() < 2)
      continue;
    std::vector<std::pair<int, int>> ends;
    for (const auto& halves : wedges) {
      const Triangle& t = arrangement_.facet(halves[0] / 2).points;
      ends.emplace_back(corner_[halves[0]][corner_at(t, u)], corner_[halves[0]][corner_at(t, v)]);
    }
    std::sort(ends.begin(), ends.end());
    if (std::adjacent_find(ends.begin(), ends.end()) == ends.end())
      continue;
    const Vector3 &from = arrangement_.position(u), &to = arrangement_.position(v);
    std::vector<Middle>& middles = middles_[key_of(u, v)];
    const int point = -2 - extra_points_++;
    for (const auto& halves : wedges) {
      const int vertex = new_vertex(0.5 * (from + to), point, u);
      Vector3 normals = Vector3::Zero();
      for (const int half : halves)
        if (!arrangement_.on_surface(half / 2))
          normals += outward(half);
      wound_.evaluation[vertex] += offset(normals, 2, (to - from).norm());
      middles.push_back({halves, vertex});
    }
  }
}

void WoundAssembly::emit(const Region& region) {
  for (const int f : region.facets) {
    const int half = 2 * f;
    if (!arrangement_.on_surface(f) && corner_[half] == corner_[half + 1] && middle_of(half, 0) < 0 &&
        middle_of(half, 1) < 0 && middle_of(half, 2) < 0) {
      // A sheet of one triangle: its two faces would have all their vertices in common.
      const Triangle& t = arrangement_.facet(f).points;
      const Vector3 &a = arrangement_.position(t[0]), &b = arrangement_.position(t[1]),
                    &c = arrangement_.position(t[2]);
      const int point = -2 - extra_points_++;
      for (const int side : {half, half + 1}) {
        const int vertex = new_vertex((a + b + c) / 3, point, t[0]);
        wound_.evaluation[vertex] += offset(outward(side), 1, (b - a).norm());
        centres_[side] = vertex;
      }
    }
    emit_half(half);
    if (!arrangement_.on_surface(f))
      emit_half(half + 1);
  }
}

int WoundAssembly::middle_of(int half, int edge) const {
  if (middles_.empty())
    return -1;
  const Triangle& t = arrangement_.facet(half / 2).points;
  const auto found = middles_.find(key_of(t[edge], t[(edge + 1) % 3]));
  if (found != middles_.end())
    for (const Middle& middle : found->second)
      if (middle.halves[0] == half || middle.halves[1] == half)
        return middle.vertex;
  return -1;
}

void WoundAssembly::emit_half(int half) {
  const std::array<int, 3>& c = corner_[half];
  if (const auto centre = centres_.find(half); centre != centres_.end()) {
    for (int e = 0; e < 3; ++e)
      new_triangle(half, e, c[e], c[(e + 1) % 3], centre->second);
    return;
  }
  const std::array<int, 3> m = {middle_of(half, 0), middle_of(half, 1), middle_of(half, 2)};
  const auto split = std::count_if(m.begin(), m.end(), [](int vertex) { return vertex >= 0; });
  if (split == 0) {
    new_triangle(half, 0, c[0], c[1], c[2]);
  } else if (split == 1) {
    const int e = m[0] >= 0 ? 0 : m[1] >= 0 ? 1 : 2, apex = (e + 2) % 3;
    new_triangle(half, 0, c[e], m[e], c[apex]);
    new_triangle(half, 1, m[e], c[(e + 1) % 3], c[apex]);
  } else if (split == 2) {
    const int e = m[0] < 0 ? 0 : m[1] < 0 ? 1 : 2; // the whole edge
    const int a = c[e], b = c[(e + 1) % 3], after = m[(e + 1) % 3], before = m[(e + 2) % 3];
    new_triangle(half, 0, c[(e + 2) % 3], before, after);
    const Vector3 &x = wound_.surface.vertices[a], &y = wound_.surface.vertices[b];
    if (std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end())) {
      new_triangle(half, 1, a, b, after);
      new_triangle(half, 2, a, after, before);
    } else {
      new_triangle(half, 1, a, b, before);
      new_triangle(half, 2, b, after, before);
    }
  } else {
    for (int e = 0; e < 3; ++e)
      new_triangle(half, e, c[e], m[e], m[(e + 2) % 3]);
    new_triangle(half, 3, m[0], m[1], m[2]);
  }
}

std::vector<int> WoundAssembly::halves_of(const std::vector<int>& facets) const {
  std::vector<int> halves;
  halves.reserve(2 * facets.size());
  for (const int f : facets) {
    halves.push_back(2 * f);
    if (!arrangement_.on_surface(f))
      halves.push_back(2 * f + 1);
  }
  std::sort(halves.begin(), halves.end());
  return halves;
}

Vector3 WoundAssembly::outward(int half) const {
  // From the whole triangle: facets can be arbitrarily thin.
  const auto [a, b, c] = arrangement_.source_corners(arrangement_.facet(half / 2).source);
  const Vector3 normal = (b - a).cross(c - a).normalized();
  return half % 2 == 0 ? normal : Vector3(-normal);
}

double WoundAssembly::tetrahedron(int triangle) const {
  const Triangle& t = wound_.surface.triangles[triangle];
  const std::vector<Vector3>& x = wound_.surface.vertices;
  return (x[t[0]] - centre_).dot((x[t[1]] - centre_).cross(x[t[2]] - centre_)) / 6;
}

} // namespace spherecut::topology
