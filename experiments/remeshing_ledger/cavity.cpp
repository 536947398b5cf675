#include "experiments/remeshing_ledger/cavity.hpp"

#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/surface_patch.hpp"
#include "experiments/remeshing_ledger/tet_mesh.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <set>

namespace spherecut::experiments::ledger {

namespace {

using Edge = std::array<int, 2>; // ascending

constexpr double on_surface = 1e-6;   // of the organ's size: a vertex lies on a plane or a curve
constexpr double coarse = 2.0;        // sizes: longer edges are too long
constexpr double volume_share = 0.03; // a curved skin triangulated anew encloses so much more or less

Edge edge_between(int a, int b) {
  return {std::min(a, b), std::max(a, b)};
}

class CavityMaker {
 public:
  CavityMaker(const TetMesh& mesh, const Scenario& scenario, int before, int now, const Grading& size, double reach,
              double tolerance)
      : mesh_(mesh), scenario_(scenario), before_(before), now_(now), size_(size), tolerance_(tolerance) {
    choose(reach);
  }

  Cavity make() {
    sort_faces();
    sort_skin();
    draw_curves();
    for (const Triangle& t : shared_)
      add({point(t[0]), point(t[1]), point(t[2])});
    cavity_.shared = std::ssize(shared_);
    for (std::size_t g = 0; g < skin_.size(); ++g) {
      if (!touched_[g]) {
        for (const Triangle& t : skin_[g])
          add({point(t[0]), point(t[1]), point(t[2])});
      } else if (!skin_[g].empty()) {
        triangulate_skin(g);
      }
    }
    const std::ptrdiff_t before_cut = std::ssize(cavity_.border.triangles);
    triangulate_cut();
    cavity_.on_cut = std::ssize(cavity_.border.triangles) - before_cut;
    for (const Vector3& x : cavity_.border.points)
      cavity_.border.sizes.push_back(size_(x));
    return std::move(cavity_);
  }

 private:
  void choose(double reach) {
    const std::vector<Vector3> from = leading_edge(scenario_, before_), to = leading_edge(scenario_, now_);
    std::vector<char> within(mesh_.vertices.size());
    for (std::size_t i = 0; i < within.size(); ++i)
      within[i] = std::min(distance_to(from, mesh_.vertices[i]), distance_to(to, mesh_.vertices[i])) < reach ? 1 : 0;
    cavity_.removed.assign(mesh_.tets.size(), 0);
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t)
      cavity_.removed[t] =
          std::any_of(mesh_.tets[t].begin(), mesh_.tets[t].end(), [&](int v) { return within[v] != 0; }) ||
                  is_coarse(mesh_, static_cast<int>(t), size_)
              ? 1
              : 0;
    // No kept tetrahedron sticks out into it.
    for (int pass = 0; pass < 4; ++pass) {
      const std::vector<TetFace> faces = local_faces();
      std::map<int, int> open;
      for (std::size_t i = 0; i + 1 < faces.size(); ++i)
        if (faces[i].key == faces[i + 1].key) {
          const int a = local_[faces[i].tet], b = local_[faces[i + 1].tet];
          if (cavity_.removed[a] != cavity_.removed[b])
            ++open[cavity_.removed[a] != 0 ? b : a];
          ++i;
        }
      bool changed = false;
      for (const auto& [tet, count] : open)
        if (count >= 3) {
          cavity_.removed[tet] = 1;
          changed = true;
        }
      if (!changed)
        break;
    }
  }

  /// Faces of the tetrahedra that have a vertex of a removed one; `tet` is a place in local_.
  std::vector<TetFace> local_faces() {
    at_hole_.assign(mesh_.vertices.size(), 0);
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t)
      if (cavity_.removed[t] != 0)
        for (int v : mesh_.tets[t])
          at_hole_[v] = 1;
    local_.clear();
    std::vector<std::array<int, 4>> tets;
    for (int t = 0; t < std::ssize(mesh_.tets); ++t)
      if (const auto& tet = mesh_.tets[t];
          std::any_of(tet.begin(), tet.end(), [&](int v) { return at_hole_[v] != 0; })) {
        local_.push_back(t);
        tets.push_back(tet);
      }
    return sorted_faces(tets);
  }

  [[nodiscard]] bool in_plane(int v) const { return std::abs(scenario_.height(mesh_.vertices[v])) < tolerance_; }

  [[nodiscard]] bool is_above(int tet) const {
    double sum = 0;
    for (int v : mesh_.tets[tet])
      sum += in_plane(v) ? 0 : scenario_.height(mesh_.vertices[v]);
    return sum > 0;
  }

  /// What bounds the hole, and the old faces of the cut inside.
  void sort_faces() {
    const std::vector<Vector2> outline = scenario_.outline(before_);
    const std::vector<TetFace> faces = local_faces();
    fixed_.assign(mesh_.vertices.size(), 0);
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
      const auto& tet = mesh_.tets[t];
      if (cavity_.removed[t] != 0)
        cavity_.volume += six_volumes(mesh_.vertices[tet[0]], mesh_.vertices[tet[1]], mesh_.vertices[tet[2]],
                                      mesh_.vertices[tet[3]]) /
                          6;
      else
        for (int v : tet)
          fixed_[v] = 1;
    }
    for (int t : local_)
      if (const auto& tet = mesh_.tets[t]; cavity_.removed[t] == 0)
        for (int i = 0; i < 4; ++i)
          for (int j = i + 1; j < 4; ++j)
            kept_edges_.insert(edge_between(tet[i], tet[j]));
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const int a = local_[faces[i].tet];
      const bool paired = i + 1 < faces.size() && faces[i + 1].key == faces[i].key;
      const auto& key = faces[i].key;
      if (!paired) {
        if (cavity_.removed[a] != 0)
          all_skin_.push_back(key);
        continue;
      }
      const int b = local_[faces[++i].tet];
      if (cavity_.removed[a] != cavity_.removed[b])
        shared_.push_back(key);
      else if (cavity_.removed[a] != 0 && in_plane(key[0]) && in_plane(key[1]) && in_plane(key[2]) &&
               is_above(a) != is_above(b) &&
               inside(outline, scenario_.in_plane(
                                   (mesh_.vertices[key[0]] + mesh_.vertices[key[1]] + mesh_.vertices[key[2]]) / 3)))
        old_cut_.push_back(key);
    }
  }

  [[nodiscard]] bool is_on(const Plane& plane, const Vector3& x) const {
    return std::abs(plane.signed_distance(x)) < on_surface * scenario_.size;
  }

  /// The skin by planes, the curved part last. Where the cut meets it, it is triangulated anew.
  void sort_skin() {
    const std::vector<Plane>& planes = scenario_.domain->planes();
    curves_ = cut_curves(scenario_, now_);
    skin_.resize(planes.size() + 1);
    touched_.assign(skin_.size(), false);
    touched_.back() = !curves_.border.empty();
    for (std::size_t g = 0; g < planes.size(); ++g)
      for (const auto& curve : curves_.border)
        if (is_on(planes[g], curve.front()) && is_on(planes[g], curve.back()))
          touched_[g] = true;
    std::map<int, std::set<std::size_t>> groups;
    for (const Triangle& t : all_skin_) {
      std::size_t g = 0;
      while (g < planes.size() &&
             !std::all_of(t.begin(), t.end(), [&](int v) { return is_on(planes[g], mesh_.vertices[v]); }))
        ++g;
      skin_[g].push_back(t);
      for (int v : t) {
        groups[v].insert(g);
        if (!touched_[g])
          fixed_[v] = 1;
      }
      if (!touched_[g])
        for (int k = 0; k < 3; ++k)
          kept_edges_.insert(edge_between(t[k], t[(k + 1) % 3]));
    }
    for (const auto& [v, of] : groups)
      if (of.size() > 1)
        fixed_[v] = 1;
  }

  int point(int vertex) {
    const auto [entry, fresh] = point_of_.try_emplace(vertex, static_cast<int>(cavity_.vertex.size()));
    if (fresh) {
      cavity_.vertex.push_back(vertex);
      cavity_.border.points.push_back(mesh_.vertices[vertex]);
    }
    return entry->second;
  }

  int new_point(const Vector3& x) {
    cavity_.vertex.push_back(-1);
    cavity_.border.points.push_back(x);
    return static_cast<int>(cavity_.vertex.size()) - 1;
  }

  void add(const Triangle& t) { cavity_.border.triangles.push_back(t); }

  /// New edges along the front and the border, between vertices on them that stay.
  void draw_curves() {
    std::vector<int> candidates;
    for (int v = 0; v < std::ssize(mesh_.vertices); ++v)
      if (fixed_[v] != 0 && in_plane(v))
        candidates.push_back(v);
    for (const auto& curve : curves_.border)
      draw(curve, candidates, border_edges_);
    for (const auto& curve : curves_.front)
      draw(curve, candidates, front_edges_);
  }

  void draw(const std::vector<Vector3>& curve, const std::vector<int>& candidates, std::vector<Edge>& edges) {
    std::vector<double> start{0};
    for (std::size_t i = 0; i + 1 < curve.size(); ++i)
      start.push_back(start.back() + (curve[i + 1] - curve[i]).norm());
    const double length = start.back(), rounding = on_surface * scenario_.size;
    const bool closed = curve.front() == curve.back();
    const auto at = [&](double s) -> Vector3 {
      std::size_t i = 0;
      while (i + 2 < curve.size() && start[i + 1] < s)
        ++i;
      return curve[i] + (s - start[i]) / (start[i + 1] - start[i]) * (curve[i + 1] - curve[i]);
    };
    struct Stop {
      double s;
      int vertex; // -1: none yet
    };
    std::vector<Stop> stops;
    for (int v : candidates)
      for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
        const Vector3 along = curve[i + 1] - curve[i], from = mesh_.vertices[v] - curve[i];
        const double s = std::clamp(from.dot(along) / along.squaredNorm(), 0.0, 1.0);
        if ((from - s * along).norm() < rounding) {
          stops.push_back({start[i] + s * along.norm(), v});
          break;
        }
      }
    std::sort(stops.begin(), stops.end(), [](const Stop& a, const Stop& b) { return a.s < b.s; });
    if (stops.empty() || stops.front().s > rounding)
      stops.insert(stops.begin(), {0, -1});
    if (closed)
      stops.push_back({length, stops.front().vertex});
    else if (stops.back().s < length - rounding)
      stops.push_back({length, -1});
    std::vector<int> ends(stops.size(), -1); // points of the border
    for (std::size_t i = 0; i + 1 < stops.size(); ++i) {
      const Stop &a = stops[i], &b = stops[i + 1];
      if (a.vertex >= 0 && b.vertex >= 0 && kept_edges_.count(edge_between(a.vertex, b.vertex)) != 0)
        continue;
      if ((a.vertex >= 0 && at_hole_[a.vertex] == 0) || (b.vertex >= 0 && at_hole_[b.vertex] == 0))
        continue; // an edge elsewhere
      if (a.vertex >= 0)
        ends[i] = point(a.vertex);
      else if (ends[i] < 0)
        ends[i] = end_point(at(a.s));
      if (b.vertex >= 0)
        ends[i + 1] = point(b.vertex);
      else
        ends[i + 1] = closed && i + 2 == stops.size() ? ends.front() : end_point(at(b.s));
      const int pieces =
          std::max(closed ? 3 : 1, static_cast<int>(std::lround((b.s - a.s) / size_(at(0.5 * (a.s + b.s))))));
      int last = ends[i];
      for (int k = 1; k <= pieces; ++k) {
        const int next = k == pieces ? ends[i + 1] : new_point(at(a.s + (b.s - a.s) * k / pieces));
        edges.push_back({last, next});
        last = next;
      }
    }
  }

  /// Ends of curves are corners that meet.
  int end_point(const Vector3& x) {
    for (int p : ends_)
      if ((cavity_.border.points[p] - x).norm() < on_surface * scenario_.size)
        return p;
    ends_.push_back(new_point(x));
    return ends_.back();
  }

  /// Edges of triangles of the mesh, with how many have them.
  static std::map<Edge, int> edges_of(const std::vector<Triangle>& triangles) {
    std::map<Edge, int> edges;
    for (const Triangle& t : triangles)
      for (int k = 0; k < 3; ++k)
        ++edges[edge_between(t[k], t[(k + 1) % 3])];
    return edges;
  }

  /// Collects points of the border for a patch and takes its triangles over.
  struct Sketch {
    std::map<int, int> place; // of a point of the border
    std::vector<int> points;
    PatchRequest request;
    int operator()(int point) {
      const auto [entry, fresh] = place.try_emplace(point, static_cast<int>(points.size()));
      if (fresh)
        points.push_back(point);
      return entry->second;
    }
  };

  void take(Sketch& sketch, const std::function<Vector2(const Vector3&)>& flatten,
            const std::function<Vector3(const Vector2&)>& lift) {
    for (int p : sketch.points)
      sketch.request.points.push_back(flatten(cavity_.border.points[p]));
    sketch.request.size = [&](const Vector2& p) { return size_(lift(p)); };
    const Patch patch = triangulate_patch(sketch.request);
    for (std::size_t i = sketch.points.size(); i < patch.points.size(); ++i)
      sketch.points.push_back(new_point(lift(patch.points[i])));
    for (const Triangle& t : patch.triangles)
      add({sketch.points[t[0]], sketch.points[t[1]], sketch.points[t[2]]});
  }

  void triangulate_skin(std::size_t g) {
    const std::vector<Plane>& planes = scenario_.domain->planes();
    const bool curved = g == planes.size();
    Vector3 origin = Vector3::Zero(), normal = Vector3::Zero();
    for (const Triangle& t : skin_[g]) {
      origin += (mesh_.vertices[t[0]] + mesh_.vertices[t[1]] + mesh_.vertices[t[2]]) / 3.0 /
                static_cast<double>(skin_[g].size());
      if (curved)
        normal += scenario_.domain->normal((mesh_.vertices[t[0]] + mesh_.vertices[t[1]] + mesh_.vertices[t[2]]) / 3);
    }
    normal = curved ? normal.normalized() : planes[g].normal;
    const Vector3 first = normal.unitOrthogonal(), second = normal.cross(first);
    const auto lift = [&](const Vector2& p) {
      Vector3 x = origin + p.x() * first + p.y() * second;
      for (int step = 0; step < (curved ? 4 : 1); ++step)
        x -= curved ? Vector3(scenario_.domain->signed_distance(x) / scenario_.domain->normal(x).dot(normal) * normal)
                    : Vector3(planes[g].signed_distance(x) * normal);
      return x;
    };
    Sketch sketch;
    for (const auto& [edge, count] : edges_of(skin_[g])) {
      if (count == 1)
        sketch.request.outline.push_back({sketch(point(edge[0])), sketch(point(edge[1]))});
      else if (kept_edges_.count(edge) != 0)
        sketch.request.lines.push_back({sketch(point(edge[0])), sketch(point(edge[1]))});
    }
    for (const Triangle& t : skin_[g])
      for (int v : t)
        if (fixed_[v] != 0)
          sketch(point(v));
    for (const Edge& edge : border_edges_)
      if (curved ||
          (is_on(planes[g], cavity_.border.points[edge[0]]) && is_on(planes[g], cavity_.border.points[edge[1]])))
        sketch.request.lines.push_back({sketch(edge[0]), sketch(edge[1])});
    take(
        sketch, [&](const Vector3& x) { return Vector2((x - origin).dot(first), (x - origin).dot(second)); }, lift);
  }

  void triangulate_cut() {
    Sketch sketch;
    for (const auto& [edge, count] : edges_of(old_cut_))
      if (kept_edges_.count(edge) != 0)
        (count == 1 ? sketch.request.outline : sketch.request.lines)
            .push_back({sketch(point(edge[0])), sketch(point(edge[1]))});
    for (const Triangle& t : old_cut_)
      for (int v : t)
        if (fixed_[v] != 0)
          sketch(point(v));
    for (const auto* edges : {&border_edges_, &front_edges_})
      for (const Edge& edge : *edges)
        sketch.request.outline.push_back({sketch(edge[0]), sketch(edge[1])});
    take(
        sketch, [&](const Vector3& x) { return scenario_.in_plane(x); },
        [&](const Vector2& p) { return scenario_.in_space(p); });
  }

  const TetMesh& mesh_;
  const Scenario& scenario_;
  int before_, now_;
  const Grading& size_;
  double tolerance_;
  Cavity cavity_;
  std::vector<int> local_;            // tetrahedra at the hole
  std::vector<char> at_hole_, fixed_; // by vertex: a removed tetrahedron has it; it stays
  std::set<Edge> kept_edges_;
  std::vector<Triangle> shared_, all_skin_, old_cut_;
  std::vector<std::vector<Triangle>> skin_;
  std::vector<bool> touched_;
  CutCurves curves_;
  std::map<int, int> point_of_; // of a vertex
  std::vector<int> ends_;
  std::vector<Edge> border_edges_, front_edges_; // between points of the border
};

} // namespace

bool is_coarse(const TetMesh& mesh, int tet, const Grading& size) {
  const auto& t = mesh.tets[tet];
  Vector3 middle = Vector3::Zero();
  double longest = 0;
  for (int i = 0; i < 4; ++i) {
    middle += mesh.vertices[t[i]] / 4;
    for (int j = 0; j < i; ++j)
      longest = std::max(longest, (mesh.vertices[t[i]] - mesh.vertices[t[j]]).norm());
  }
  return longest > coarse * size.fine && longest > coarse * size(middle);
}

Cavity open_cavity(const TetMesh& mesh, const Scenario& scenario, int before, int now, const Grading& size,
                   double reach, double tolerance) {
  return CavityMaker(mesh, scenario, before, now, size, reach, tolerance).make();
}

void close_cavity(TetMesh& mesh, const Cavity& cavity, const TetMesh& filling) {
  double volume = 0;
  for (const auto& t : filling.tets)
    volume +=
        six_volumes(filling.vertices[t[0]], filling.vertices[t[1]], filling.vertices[t[2]], filling.vertices[t[3]]) / 6;
  if (std::abs(volume / cavity.volume - 1) > volume_share)
    throw NumericalError(fmt::format("a cavity of {} m3 was filled with {} m3", cavity.volume, volume));
  const std::vector<TetFace> faces = sorted_faces(filling.tets);
  const auto times = [&](Triangle key) {
    std::sort(key.begin(), key.end());
    const auto range = std::equal_range(faces.begin(), faces.end(), TetFace{key, 0, 0},
                                        [](const TetFace& a, const TetFace& b) { return a.key < b.key; });
    return range.second - range.first;
  };
  const auto& triangles = cavity.border.triangles;
  const std::ptrdiff_t first_of_cut = std::ssize(triangles) - cavity.on_cut;
  for (std::ptrdiff_t i = 0; i < std::ssize(triangles); ++i)
    if (times(triangles[static_cast<std::size_t>(i)]) != (i < first_of_cut ? 1 : 2))
      throw NumericalError(
          fmt::format("the filling of a cavity lacks triangle {} of {} of its border", i, triangles.size()));
  std::vector<int> vertex = cavity.vertex;
  vertex.resize(filling.vertices.size(), -1);
  for (std::size_t i = 0; i < vertex.size(); ++i)
    if (vertex[i] < 0) {
      vertex[i] = static_cast<int>(mesh.vertices.size());
      mesh.vertices.push_back(filling.vertices[i]);
    }
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (cavity.removed[t] == 0)
      mesh.tets[kept++] = mesh.tets[t];
  mesh.tets.resize(kept);
  for (const auto& t : filling.tets)
    mesh.tets.push_back({vertex[t[0]], vertex[t[1]], vertex[t[2]], vertex[t[3]]});
}

} // namespace spherecut::experiments::ledger
