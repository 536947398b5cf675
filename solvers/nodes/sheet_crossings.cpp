#include "solvers/nodes/sheet_crossings.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::solvers {

namespace {

constexpr double steepest_crossing = 0.2; // sine of the angle below which an edge runs along a sheet

/// Appends the points where the segment a b meets a sheet, in order.
void find_crossings(const Vector3& a, const Vector3& b, const topology::Incision& incision, int depth,
                    std::vector<Vector3>& found) {
  if (depth > 6 || !incision.blocks(a, b))
    return;
  const Vector3 ab = b - a;
  double low = 0, high = 1; // a .. low is clear, a .. high is not
  for (int step = 0; step < 44; ++step) {
    const double middle = 0.5 * (low + high);
    (incision.blocks(a, a + middle * ab) ? high : low) = middle;
  }
  found.push_back(a + high * ab);
  if (high < 1 - 1e-6)
    find_crossings(a + (high + 1e-6) * ab, b, incision, depth + 1, found);
}

/// Appends the points where the edges of triangle p meet triangle q.
void edges_through(const std::array<Vector3, 3>& p, const std::array<Vector3, 3>& q, std::vector<Vector3>& hits) {
  constexpr double slack = 1e-9;
  const Vector3 u = q[1] - q[0], v = q[2] - q[0], normal = u.cross(v);
  for (int e = 0; e < 3; ++e) {
    const Vector3 &a = p[e], d = p[(e + 1) % 3] - a;
    const double slope = normal.dot(d);
    if (std::abs(slope) < 1e-12 * normal.norm() * d.norm())
      continue;
    const double t = normal.dot(q[0] - a) / slope;
    if (t < -slack || t > 1 + slack)
      continue;
    const Vector3 w = a + t * d - q[0];
    const double s = w.cross(v).dot(normal) / normal.squaredNorm(), r = u.cross(w).dot(normal) / normal.squaredNorm();
    if (s >= -slack && r >= -slack && s + r <= 1 + slack)
      hits.emplace_back(q[0] + w);
  }
}

} // namespace

double distance_to_segments(const Vector3& x, const std::vector<std::array<Vector3, 2>>& segments) {
  double squared = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : segments) {
    const Vector3 ab = b - a;
    const double length = ab.squaredNorm(), t = length > 0 ? std::clamp(ab.dot(x - a) / length, 0.0, 1.0) : 0.0;
    squared = std::min(squared, (a + t * ab - x).squaredNorm());
  }
  return std::sqrt(squared);
}

Vector3 onto_sharp_edge(const topology::Domain& domain, const topology::SurfaceMesh& surface, const SharpCurve& curve,
                        int segment, const Vector3& x) {
  // The normal cone is entered along the mean normal of the two triangles, outwards at a convex edge, inwards at a
  // concave one.
  const auto& [left, right] = curve.faces[segment];
  const Vector3 mean = topology::triangle_normal(surface, left) + topology::triangle_normal(surface, right);
  const Vector3 chord = surface.vertices[curve.vertices[segment + 1]] - surface.vertices[curve.vertices[segment]];
  const double length = chord.norm();
  if (mean.norm() < 1e-6)
    return domain.closest_surface_point(x);
  const Vector3 step = (curve.convex[segment] ? 0.25 : -0.25) * length * mean.normalized(), along = chord / length;
  Vector3 on_edge = domain.closest_surface_point(x + step), start = x;
  for (int correction = 0; correction < 2; ++correction) { // of the drift along the edge
    start -= along * along.dot(on_edge - x);
    on_edge = domain.closest_surface_point(start + step);
  }
  return (on_edge - x).norm() < 0.3 * length ? on_edge : domain.closest_surface_point(x);
}

std::vector<SharpCrossing> edge_crossings(const topology::Domain& domain, const SharpFeatures& features,
                                          const SpacingField& spacing, const topology::Incision& incision,
                                          const topology::SurfaceMesh& surface, const BoundingBox* region) {
  std::vector<SharpCrossing> result;
  std::vector<Vector3> found;
  for (int c = 0; c < std::ssize(features.curves); ++c) {
    const SharpCurve& curve = features.curves[c];
    for (int s = 0; s + 1 < std::ssize(curve.vertices); ++s) {
      const Vector3 &a = surface.vertices[curve.vertices[s]], &b = surface.vertices[curve.vertices[s + 1]];
      if (!within(region, box_of(a, b)) || !incision.near(0.5 * (a + b), 0.5 * (b - a).norm()))
        continue;
      found.clear();
      find_crossings(a, b, incision, 0, found);
      const Vector3 chord = (b - a).normalized();
      for (Vector3 x : found) {
        const double h = spacing(x);
        std::optional<topology::SheetPoint> nearest;
        Vector3 along = chord;
        double sine = 0;
        for (int correction = 0; correction < 8; ++correction) { // onto the exact edge, along it onto the sheet
          const Vector3 before = x, step = 0.01 * h * along;
          along = (onto_sharp_edge(domain, surface, curve, s, x + step) -
                   onto_sharp_edge(domain, surface, curve, s, x - step))
                      .normalized();
          x = onto_sharp_edge(domain, surface, curve, s, x);
          nearest = incision.closest(x, h);
          sine = nearest ? along.dot(nearest->normal) : 0;
          if (std::abs(sine) < steepest_crossing)
            break;
          x += (nearest->point - x).dot(nearest->normal) / sine * along;
          if ((x - before).norm() < 1e-13 * h)
            break;
        }
        if (std::abs(sine) >= steepest_crossing)
          result.push_back({c, s, std::clamp((x - a).dot(chord) / (b - a).norm(), 0.0, 1.0), x, nearest->normal, along,
                            nearest->sheet});
      }
    }
  }
  return result;
}

std::vector<std::array<Vector3, 2>> sheet_crossings(const topology::Incision& incision, const BoundingBox* region) {
  struct Piece {
    std::array<Vector3, 3> corners;
    Triangle vertices;
    int sheet;
    BoundingBox box;
  };
  std::vector<Piece> pieces;
  BoundingBox all{Vector3::Constant(std::numeric_limits<double>::infinity()),
                  Vector3::Constant(-std::numeric_limits<double>::infinity())};
  for (int s = 0; s < std::ssize(incision.sheets()); ++s) {
    const topology::SurfaceMesh& sheet = incision.sheets()[s];
    for (const Triangle& v : sheet.triangles) {
      const std::array<Vector3, 3> corners{sheet.vertices[v[0]], sheet.vertices[v[1]], sheet.vertices[v[2]]};
      const BoundingBox box = box_of(corners[0], corners[1], corners[2]);
      if (!within(region, box))
        continue;
      pieces.push_back({corners, v, s, box});
      all = {all.lower.cwiseMin(box.lower), all.upper.cwiseMax(box.upper)};
    }
  }
  std::vector<std::array<Vector3, 2>> result;
  if (pieces.empty())
    return result;
  int axis = 0;
  all.extent().maxCoeff(&axis);
  std::stable_sort(pieces.begin(), pieces.end(),
                   [axis](const Piece& a, const Piece& b) { return a.box.lower[axis] < b.box.lower[axis]; });
  std::vector<Vector3> hits;
  for (std::size_t i = 0; i < pieces.size(); ++i)
    for (std::size_t j = i + 1; j < pieces.size() && pieces[j].box.lower[axis] <= pieces[i].box.upper[axis]; ++j) {
      const Piece &p = pieces[i], &q = pieces[j];
      if (!overlap(p.box, q.box))
        continue;
      if (p.sheet == q.sheet && std::any_of(p.vertices.begin(), p.vertices.end(), [&](int v) {
            return std::find(q.vertices.begin(), q.vertices.end(), v) != q.vertices.end();
          }))
        continue;
      hits.clear();
      edges_through(p.corners, q.corners, hits);
      edges_through(q.corners, p.corners, hits);
      if (hits.empty())
        continue;
      std::array<Vector3, 2> segment{hits[0], hits[0]};
      for (const Vector3& a : hits)
        for (const Vector3& b : hits)
          if ((a - b).squaredNorm() > (segment[0] - segment[1]).squaredNorm())
            segment = {a, b};
      result.push_back(segment);
    }
  return result;
}

} // namespace spherecut::solvers
