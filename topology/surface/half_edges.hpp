// The directed edges of a triangle mesh, found by their two vertices.
#pragma once

#include "topology/surface/mesh.hpp"

namespace spherecut::topology {

/// Lists the edges of all triangles by the vertex they start from. Vertex indices must be in range.
class HalfEdges {
 public:
  explicit HalfEdges(const SurfaceMesh& mesh) : start_(mesh.vertices.size() + 1, 0), ends_(3 * mesh.triangles.size()) {
    for (const Triangle& t : mesh.triangles)
      for (const int v : t)
        ++start_[v + 1];
    for (std::size_t v = 1; v < start_.size(); ++v)
      start_[v] += start_[v - 1];
    std::vector<int> next(start_.begin(), start_.end() - 1);
    for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t)
      for (int e = 0; e < 3; ++e)
        ends_[next[mesh.triangles[t][e]]++] = {mesh.triangles[t][(e + 1) % 3], t};
  }

  /// First triangle with the edge, in the order of the mesh; -1 when there is none.
  [[nodiscard]] int triangle(int from, int to) const {
    for (int i = start_[from]; i < start_[from + 1]; ++i)
      if (ends_[i].to == to)
        return ends_[i].triangle;
    return -1;
  }

  /// Number of edges that start from a vertex: of triangles around it.
  [[nodiscard]] int around(int vertex) const { return start_[vertex + 1] - start_[vertex]; }
  /// Some triangle around a vertex that has one.
  [[nodiscard]] int some_triangle(int vertex) const { return ends_[start_[vertex]].triangle; }

 private:
  struct End {
    int to, triangle;
  };
  std::vector<int> start_;
  std::vector<End> ends_;
};

} // namespace spherecut::topology
