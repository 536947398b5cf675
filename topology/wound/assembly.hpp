// Gluing of the facets of an arrangement into the closed surface of a wound, kept up to date where facets change.
//
// A half is one face of a facet: 2 f keeps the facet's orientation and bounds the material behind it (the organ's
// surface, or the - side of a sheet), 2 f + 1 is reversed and bounds the material before it (the + side of a sheet).
// Corners and edges of a half are counted in the order of its facet; edge e joins corners e and e + 1.
#pragma once

#include "topology/wound/exact_arrangement.hpp"
#include "topology/wound/wound.hpp"

#include <unordered_map>

namespace spherecut::topology {

class WoundAssembly {
 public:
  WoundAssembly(const SurfaceMesh& organ, const WoundOptions& options);

  /// Adds sheet triangles: sheet_of and triangle_of give each its place in the sheets. Returns what it cost.
  IncrementalWound::Growth add(const std::vector<std::array<Vector3, 3>>& triangles, const std::vector<int>& sheet_of,
                               const std::vector<int>& triangle_of);

  [[nodiscard]] const Wound& wound() const { return wound_; }

 private:
  /// Both ends of some edges stay single though their wedges part: such an edge gets a vertex of its own per wedge.
  struct Middle {
    std::array<int, 2> halves; // the two that meet in this wedge
    int vertex;
  };
  struct Output {
    std::array<int, 4> triangles{-1, -1, -1, -1};
    int component = -1;
  };
  /// What one update works on.
  struct Region {
    std::vector<int> points;                // of all changed facets, ascending
    std::vector<int> facets;                // active ones with any of these points, ascending
    std::vector<std::pair<int, int>> edges; // of these facets, with an end among the points; ascending ends
    std::vector<std::vector<std::array<int, 2>>> wedges; // per edge: pairs of halves
  };

  [[nodiscard]] Region region_of(const ExactArrangement::Change& change) const;
  int remove_outputs(const ExactArrangement::Change& change, const Region& region);
  void pair_halves(Region& region);
  void make_copies(const Region& region);
  void split_edges(const Region& region);
  void emit(const Region& region);
  void emit_half(int half);
  void compact();

  void update_components(const Region& region);
  bool keep_components(const std::vector<int>& halves);
  void label_all();
  void assign_pieces(const std::vector<bool>& flat);
  void join_along_ray(int half, std::vector<int>& group);
  void sum_pieces();

  static std::uint64_t key_of(int u, int v); // of an edge
  int new_vertex(const Vector3& position, int point, int owner);
  void new_triangle(int half, int place, int a, int b, int c);
  void drop_triangle(int triangle);
  void drop_vertex(int vertex);
  void drop_middles(int u, int v);
  [[nodiscard]] int middle_of(int half, int edge) const;
  [[nodiscard]] int half_running(int facet, int from, int to) const;
  [[nodiscard]] std::vector<int> halves_of(const std::vector<int>& facets) const;
  [[nodiscard]] Vector3 outward(int half) const;
  [[nodiscard]] Vector3 offset(const Vector3& normals, double weight, double length) const;
  [[nodiscard]] double tetrahedron(int triangle) const;

  ExactArrangement arrangement_;
  WoundOptions options_;
  Wound wound_;
  Vector3 centre_; // m, about which volumes are summed
  int organ_triangles_ = 0;
  std::vector<std::pair<int, int>> sheet_source_;                  // sheet and triangle, by source after the organ's
  std::vector<std::array<int, 3>> corner_;                         // per half: vertices of the wound
  std::vector<std::array<int, 3>> across_;                         // per half: the half beyond each edge
  std::vector<Output> output_;                                     // per half
  std::vector<std::vector<int>> copies_;                           // per point: its vertices of the wound
  std::unordered_map<std::uint64_t, std::vector<Middle>> middles_; // by edge
  std::unordered_map<int, int> centres_;                           // by half: vertex within its facet
  std::vector<int> half_of_;                                       // per triangle of the wound
  std::vector<int> owner_;            // per vertex: a point of all facets whose halves use it
  std::vector<int> vertex_component_; // per vertex
  std::vector<int> vertex_count_;     // per component
  std::vector<int> free_triangles_, free_vertices_;
  int extra_points_ = 0; // numbers given to middles and centres
};

} // namespace spherecut::topology
