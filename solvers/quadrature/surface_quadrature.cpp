// Quadrature over the surface of the body and over the faces of a cut, see background_cells.hpp.
#include "solvers/quadrature/background_cells.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

namespace spherecut::solvers {

namespace {

using Corners = std::array<Vector3, 3>;

bool is_outside(const Corners& t, const BoundingBox* region) {
  return region != nullptr && ((t[0].cwiseMax(t[1]).cwiseMax(t[2]).array() < region->lower.array()).any() ||
                               (t[0].cwiseMin(t[1]).cwiseMin(t[2]).array() > region->upper.array()).any());
}

double longest_edge(const Corners& t) {
  return std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
}

void push_quarters(const Corners& t, std::vector<Corners>& pending) {
  const Vector3 a = 0.5 * (t[0] + t[1]), b = 0.5 * (t[1] + t[2]), c = 0.5 * (t[2] + t[0]);
  pending.push_back({t[0], a, c});
  pending.push_back({a, t[1], b});
  pending.push_back({c, b, t[2]});
  pending.push_back({a, b, c});
}

/// Three points exact for quadratic functions, or the centroid alone.
void push_points(const Corners& t, bool centroid_alone, std::vector<SurfacePoint>& points) {
  const Vector3 centre = (t[0] + t[1] + t[2]) / 3, area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]);
  const double size = area.norm();
  if (size > 0 && centroid_alone)
    points.push_back({centre, area / size, size});
  else if (size > 0)
    for (const Vector3& corner : t)
      points.push_back({0.5 * (centre + corner), area / size, size / 3});
}

/// The part of a triangle where `distance`, given at its corners and linear between them, is negative.
void push_negative(const Corners& t, const std::array<double, 3>& distance, bool centroid_alone,
                   std::vector<SurfacePoint>& points) {
  std::array<Vector3, 4> kept;
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (distance[k] <= 0)
      kept[count++] = t[k];
    if ((distance[k] <= 0) != (distance[next] <= 0))
      kept[count++] = t[k] + distance[k] / (distance[k] - distance[next]) * (t[next] - t[k]);
  }
  for (int k = 1; k + 1 < count; ++k)
    push_points({kept[0], kept[k], kept[k + 1]}, centroid_alone, points);
}

/// Both parts of a triangle that the plane of the nearest sheet divides, so that no point stands for material on both
/// sides of the cut.
void push_divided(const Corners& t, const topology::Incision& incision, bool centroid_alone,
                  std::vector<SurfacePoint>& points) {
  const auto sheet = incision.closest((t[0] + t[1] + t[2]) / 3, longest_edge(t));
  if (!sheet)
    return push_points(t, centroid_alone, points);
  std::array<double, 3> above, below;
  for (int k = 0; k < 3; ++k) {
    above[k] = sheet->normal.dot(t[k] - sheet->point);
    below[k] = -above[k];
  }
  if (std::max({above[0], above[1], above[2]}) <= 0 || std::min({above[0], above[1], above[2]}) >= 0)
    return push_points(t, centroid_alone, points);
  push_negative(t, above, centroid_alone, points);
  push_negative(t, below, centroid_alone, points);
}

std::array<double, 3> distances(const Corners& t, const topology::Domain& domain) {
  return {domain.signed_distance(t[0]), domain.signed_distance(t[1]), domain.signed_distance(t[2])};
}

} // namespace

std::vector<SurfacePoint> surface_quadrature(const topology::Domain& domain, const NodeCloud& nodes, double edge,
                                             double centroid_below, const topology::Incision* incision,
                                             const BoundingBox* region) {
  const topology::PointTree tree(nodes.positions);
  const topology::SurfaceMesh& surface = domain.surface();
  std::vector<SurfacePoint> points;
  std::vector<Corners> pending;
  int node = -1; // nearest to the triangle before, which is often a neighbour
  for (const Triangle& triangle : surface.triangles) {
    pending.push_back({surface.vertices[triangle[0]], surface.vertices[triangle[1]], surface.vertices[triangle[2]]});
    while (!pending.empty()) {
      const Corners t = pending.back();
      pending.pop_back();
      if (is_outside(t, region))
        continue;
      node = tree.nearest((t[0] + t[1] + t[2]) / 3, node).index;
      const double spacing = nodes.spacings[node], longest = longest_edge(t);
      if (longest > edge * spacing)
        push_quarters(t, pending);
      else if (incision != nullptr && incision->near((t[0] + t[1] + t[2]) / 3, longest))
        push_divided(t, *incision, longest < centroid_below * spacing, points);
      else
        push_points(t, longest < centroid_below * spacing, points);
    }
  }
  return points;
}

namespace {

/// Gathers centroids of small triangles of one sheet: those that lie together and face the same way make one point,
/// with their whole area vector, on the sheet under their mean or, where another part of the cut is nearer to that, at
/// the nearest of them.
class SmallTriangles {
 public:
  SmallTriangles(const topology::Incision& incision, double finest) : incision_(incision), finest_(finest) {}

  void add(int sheet, const SurfacePoint& point, double spacing) {
    // The opening goes with the root of the distance to the front: finer there.
    const auto front = finest_ < 1 ? incision_.front_frame(point.position, spacing) : std::nullopt;
    const int level = std::ilogb(largest_group * (front ? std::max(front->distance, finest_ * spacing) : spacing));
    const double edge = std::ldexp(1.0, level);
    std::array<long, 6> key{sheet, level, 0, 0, 0, 0};
    for (int c = 0; c < 3; ++c)
      key[2 + c] = std::lround(std::floor(point.position[c] / edge));
    for (;; ++key[5]) { // of the groups at this place the first that faces this way
      const auto [found, is_new] = group_at_.try_emplace(key, groups_.size());
      if (is_new)
        groups_.push_back({{}, Vector3::Zero(), Vector3::Zero(), 0, spacing, edge, sheet});
      Group& group = groups_[found->second];
      if (!group.members.empty() && group.members.front().normal.dot(point.normal) < same_way)
        continue;
      group.moment += point.weight * point.position;
      group.area += point.weight * point.normal;
      group.weight += point.weight;
      group.members.push_back(point);
      return;
    }
  }

  /// Calls push(point on the sheet, normal of the sheet there, spacing) for every group in the order in which they were
  /// begun. The normal of the point is that of the area.
  template <typename Push>
  void for_each(const Push& push) const {
    for (const Group& group : groups_) {
      SurfacePoint point{group.moment / group.weight, group.area.normalized(), group.area.norm()};
      const auto face = incision_.closest(point.position, group.edge);
      if (face && face->sheet == group.sheet && face->normal.dot(point.normal) > same_way) {
        point.position = face->point;
        push(point, face->normal, group.spacing);
        continue;
      }
      const SurfacePoint& nearest =
          *std::min_element(group.members.begin(), group.members.end(), [&](const auto& a, const auto& b) {
            return (a.position - point.position).squaredNorm() < (b.position - point.position).squaredNorm();
          });
      point.position = nearest.position;
      push(point, nearest.normal, group.spacing);
    }
  }

 private:
  static constexpr double largest_group = 0.5, same_way = 0.95; // spacings; a cosine
  struct Group {
    std::vector<SurfacePoint> members;
    Vector3 moment, area;
    double weight, spacing, edge;
    int sheet;
  };
  const topology::Incision& incision_;
  double finest_; // spacings from the front where groups are smallest
  std::map<std::array<long, 6>, std::size_t> group_at_;
  std::vector<Group> groups_;
};

} // namespace

std::vector<SurfacePoint> lip_quadrature(const topology::Incision& incision, const NodeCloud& nodes, double edge,
                                         double centroid_below, const BoundingBox* region, double finest) {
  const topology::PointTree tree(nodes.positions);
  const topology::Domain& domain = *incision.domain();
  std::vector<SurfacePoint> points, face;
  std::vector<Corners> pending;
  SmallTriangles small_triangles(incision, finest);
  const auto push_both_sides = [&](const SurfacePoint& point, const Vector3& off, double spacing) {
    for (const double side : {1.0, -1.0})
      points.push_back({point.position + side * lip_offset * spacing * off, -side * point.normal, point.weight});
  };
  for (int s = 0; s < std::ssize(incision.sheets()); ++s) {
    const topology::SurfaceMesh& sheet = incision.sheets()[s];
    for (const Triangle& triangle : sheet.triangles) {
      pending.push_back({sheet.vertices[triangle[0]], sheet.vertices[triangle[1]], sheet.vertices[triangle[2]]});
      while (!pending.empty()) {
        const Corners t = pending.back();
        pending.pop_back();
        const Vector3 centre = (t[0] + t[1] + t[2]) / 3;
        const double longest = longest_edge(t);
        if (is_outside(t, region) || domain.signed_distance(centre) > longest)
          continue;
        const double spacing = nodes.spacings[tree.nearest(centre).index];
        if (longest > edge * spacing) {
          push_quarters(t, pending);
          continue;
        }
        // Sheets are made in strips as narrow as the steps of the blade: triangles count by their area.
        const double small = centroid_below * spacing, area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).norm();
        const bool is_small = area < 0.25 * std::sqrt(3.0) * small * small;
        face.clear();
        push_negative(t, distances(t, domain), is_small, face);
        for (const SurfacePoint& point : face)
          if (is_small)
            small_triangles.add(s, point, spacing);
          else
            push_both_sides(point, point.normal, spacing);
      }
    }
  }
  small_triangles.for_each(push_both_sides);
  return points;
}

} // namespace spherecut::solvers
