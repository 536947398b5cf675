// Dense storage of a wound's vertices and triangles while parts of it are replaced.
#include "topology/wound/assembly.hpp"

#include <algorithm>
#include <cstddef>

namespace spherecut::topology {

int WoundAssembly::new_vertex(const Vector3& position, int point, int owner) {
  int vertex = static_cast<int>(wound_.surface.vertices.size());
  if (free_vertices_.empty()) {
    wound_.surface.vertices.emplace_back();
    wound_.evaluation.emplace_back();
    wound_.point.emplace_back();
    owner_.emplace_back();
    vertex_component_.emplace_back();
  } else {
    vertex = free_vertices_.back();
    free_vertices_.pop_back();
  }
  wound_.surface.vertices[vertex] = wound_.evaluation[vertex] = position;
  wound_.point[vertex] = point;
  owner_[vertex] = owner;
  vertex_component_[vertex] = -1;
  return vertex;
}

void WoundAssembly::new_triangle(int half, int place, int a, int b, int c) {
  int triangle = static_cast<int>(wound_.surface.triangles.size());
  if (free_triangles_.empty()) {
    wound_.surface.triangles.emplace_back();
    wound_.part.emplace_back();
    wound_.sheet.emplace_back();
    wound_.source_triangle.emplace_back();
    wound_.component.emplace_back();
    half_of_.emplace_back();
  } else {
    triangle = free_triangles_.back();
    free_triangles_.pop_back();
  }
  const bool reversed = half % 2 == 1;
  const int source = arrangement_.facet(half / 2).source;
  const bool wall = source >= organ_triangles_;
  wound_.surface.triangles[triangle] = reversed ? Triangle{a, c, b} : Triangle{a, b, c};
  wound_.part[triangle] = !wall ? WoundPart::organ : reversed ? WoundPart::wall_plus : WoundPart::wall_minus;
  wound_.sheet[triangle] = wall ? sheet_source_[source - organ_triangles_].first : -1;
  wound_.source_triangle[triangle] = wall ? sheet_source_[source - organ_triangles_].second : source;
  wound_.component[triangle] = -1;
  half_of_[triangle] = half;
  output_[half].triangles[place] = triangle;
}

void WoundAssembly::drop_triangle(int triangle) {
  WoundComponent& component = wound_.components[wound_.component[triangle]];
  component.volume -= tetrahedron(triangle);
  --component.triangles;
  half_of_[triangle] = -1;
  free_triangles_.push_back(triangle);
}

void WoundAssembly::drop_vertex(int vertex) {
  --vertex_count_[vertex_component_[vertex]];
  owner_[vertex] = -1;
  free_vertices_.push_back(vertex);
}

void WoundAssembly::drop_middles(int u, int v) {
  const auto found = middles_.find(key_of(u, v));
  if (found == middles_.end())
    return;
  for (const Middle& middle : found->second)
    drop_vertex(middle.vertex);
  middles_.erase(found);
}

void WoundAssembly::compact() {
  // The last ones move into the holes; holes at the end fall off.
  const auto fill = [](std::vector<int>& holes, std::size_t& count, const auto& is_hole, const auto& move) {
    std::sort(holes.begin(), holes.end());
    for (const int hole : holes) {
      while (count > 0 && is_hole(static_cast<int>(count) - 1))
        --count;
      if (hole >= static_cast<int>(count))
        break;
      move(static_cast<int>(--count), hole);
    }
    holes.clear();
  };
  std::size_t triangles = wound_.surface.triangles.size(), vertices = wound_.surface.vertices.size();
  fill(
      free_triangles_, triangles, [&](int t) { return half_of_[t] < 0; },
      [&](int from, int to) {
        for (int& t : output_[half_of_[from]].triangles)
          if (t == from)
            t = to;
        wound_.surface.triangles[to] = wound_.surface.triangles[from];
        wound_.part[to] = wound_.part[from];
        wound_.sheet[to] = wound_.sheet[from];
        wound_.source_triangle[to] = wound_.source_triangle[from];
        wound_.component[to] = wound_.component[from];
        half_of_[to] = half_of_[from];
        half_of_[from] = -1;
      });
  fill(
      free_vertices_, vertices, [&](int v) { return owner_[v] < 0; },
      [&](int from, int to) {
        const auto rename = [&](int& vertex) {
          if (vertex == from)
            vertex = to;
        };
        std::vector<int> facets;
        arrangement_.facets_at(owner_[from], facets);
        for (const int half : halves_of(facets)) {
          for (int& vertex : corner_[half])
            rename(vertex);
          for (const int t : output_[half].triangles)
            if (t >= 0)
              for (int& vertex : wound_.surface.triangles[t])
                rename(vertex);
          if (const auto centre = centres_.find(half); centre != centres_.end())
            rename(centre->second);
          const Triangle& t = arrangement_.facet(half / 2).points;
          for (int e = 0; e < 3; ++e)
            if (const auto found = middles_.find(key_of(t[e], t[(e + 1) % 3])); found != middles_.end())
              for (Middle& middle : found->second)
                rename(middle.vertex);
        }
        for (int& vertex : copies_[owner_[from]])
          rename(vertex);
        wound_.surface.vertices[to] = wound_.surface.vertices[from];
        wound_.evaluation[to] = wound_.evaluation[from];
        wound_.point[to] = wound_.point[from];
        owner_[to] = owner_[from];
        vertex_component_[to] = vertex_component_[from];
        owner_[from] = -1;
      });
  wound_.surface.triangles.resize(triangles);
  wound_.part.resize(triangles);
  wound_.sheet.resize(triangles);
  wound_.source_triangle.resize(triangles);
  wound_.component.resize(triangles);
  half_of_.resize(triangles);
  wound_.surface.vertices.resize(vertices);
  wound_.evaluation.resize(vertices);
  wound_.point.resize(vertices);
  owner_.resize(vertices);
  vertex_component_.resize(vertices);
}

} // namespace spherecut::topology
