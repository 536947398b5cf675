#include "experiments/remeshing_ledger/surface_patch.hpp"

#include "topology/base/errors.hpp"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <algorithm>
#include <cmath>
#include <deque>
#include <fmt/format.h>
#include <set>

namespace spherecut::experiments::ledger {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<int, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<int, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Triangulation =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>,
                                               CGAL::No_constraint_intersection_tag>;
using Point = Kernel::Point_2;
using Face = Triangulation::Face_handle;

constexpr double wide = 0.62;  // of the size: larger circles about a triangle ask for a point
constexpr double apart = 0.65; // of the size, from every corner
constexpr double off = 0.4;    // of the size, from outline and lines
constexpr int passes = 30;

class Triangulator {
 public:
  explicit Triangulator(const PatchRequest& request) : request_(request) {
    patch_.points = request.points;
    for (int i = 0; i < std::ssize(request.points); ++i) {
      const auto vertex = mesh_.insert({request.points[i].x(), request.points[i].y()});
      vertex->info() = i;
      vertices_.push_back(vertex);
    }
    for (const auto& edge : request.outline)
      constrain(edge);
    for (const auto& edge : request.lines) {
      constrain(edge);
      lines_.insert(std::minmax(edge[0], edge[1]));
    }
  }

  Patch run() {
    for (int pass = 0; pass < passes; ++pass) {
      mark();
      if (!refine())
        break;
    }
    mark();
    for (Face face : mesh_.finite_face_handles())
      if (face->info() % 2 == 1)
        patch_.triangles.push_back({face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()});
    if (patch_.triangles.empty())
      throw NumericalError("the outline of a part of a surface holds no triangle");
    return std::move(patch_);
  }

 private:
  void constrain(const std::array<int, 2>& edge) {
    try {
      mesh_.insert_constraint(vertices_[edge[0]], vertices_[edge[1]]);
    } catch (const Triangulation::Intersection_of_constraints_exception&) {
      throw NumericalError(fmt::format("edge {}-{} of a part of a surface crosses another", edge[0], edge[1]));
    }
  }

  /// Counts the outlines between a triangle and the outside.
  void mark() {
    for (Face face : mesh_.all_face_handles())
      face->info() = -1;
    std::deque<std::pair<Face, int>> border{{mesh_.infinite_face(), 0}};
    while (!border.empty()) {
      const auto [first, level] = border.front();
      border.pop_front();
      if (first->info() != -1)
        continue;
      std::vector<Face> open{first};
      while (!open.empty()) {
        const Face face = open.back();
        open.pop_back();
        if (face->info() != -1)
          continue;
        face->info() = level;
        for (int k = 0; k < 3; ++k) {
          const Face next = face->neighbor(k);
          if (next->info() != -1)
            continue;
          if (is_outline(face, k))
            border.emplace_back(next, level + 1);
          else
            open.push_back(next);
        }
      }
    }
  }

  [[nodiscard]] bool is_outline(Face face, int k) const {
    if (!face->is_constrained(k))
      return false;
    const int a = face->vertex(Triangulation::ccw(k))->info(), b = face->vertex(Triangulation::cw(k))->info();
    return lines_.count(std::minmax(a, b)) == 0;
  }

  [[nodiscard]] bool has_room(const Vector2& p, double size) const {
    for (const Vector2& q : patch_.points)
      if ((p - q).norm() < apart * size)
        return false;
    const auto near = [&](const std::array<int, 2>& edge) {
      const Vector2 &a = request_.points[edge[0]], along = request_.points[edge[1]] - a;
      const double s = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
      return (p - a - s * along).norm() < off * size;
    };
    return std::none_of(request_.outline.begin(), request_.outline.end(), near) &&
           std::none_of(request_.lines.begin(), request_.lines.end(), near);
  }

  /// Puts points in the middle of the circles about wide triangles, where there is room.
  bool refine() {
    std::vector<Vector2> wanted;
    for (Face face : mesh_.finite_face_handles()) {
      if (face->info() % 2 != 1)
        continue;
      const Point middle = mesh_.circumcenter(face);
      const Vector2 p(middle.x(), middle.y()), corner = patch_.points[face->vertex(0)->info()];
      if ((p - corner).norm() > wide * request_.size(p))
        wanted.push_back(p);
    }
    bool changed = false;
    for (const Vector2& p : wanted) {
      const Point point(p.x(), p.y());
      const Face at = mesh_.locate(point);
      if (mesh_.is_infinite(at) || at->info() % 2 != 1 || !has_room(p, request_.size(p)))
        continue;
      const auto vertex = mesh_.insert(point, at);
      vertex->info() = static_cast<int>(patch_.points.size());
      patch_.points.push_back(p);
      for (auto around = mesh_.incident_faces(vertex), last = around;;) {
        around->info() = 1; // no constraint is crossed by the new triangles
        if (++around == last)
          break;
      }
      changed = true;
    }
    return changed;
  }

  const PatchRequest& request_;
  Triangulation mesh_;
  std::vector<Triangulation::Vertex_handle> vertices_;
  std::set<std::pair<int, int>> lines_;
  Patch patch_;
};

} // namespace

Patch triangulate_patch(const PatchRequest& request) {
  return Triangulator(request).run();
}

} // namespace spherecut::experiments::ledger
