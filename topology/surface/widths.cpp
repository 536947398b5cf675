#include "topology/surface/widths.hpp"

#include "topology/search/box_tree.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::topology {

namespace {

constexpr double most_rays = 40000;
constexpr double parallel = 0.906;   // cosine of 25 degrees
constexpr double off_surface = 1e-7; // of the body's size, where a ray starts
constexpr double mostly = 0.75;      // of the surface about a thin place
constexpr double surroundings = 4;   // widths about it

/// Place along the segment a b where it meets the triangle, 0 to 1; infinity where it does not.
double meeting_place(const Vector3& a, const Vector3& b, const std::array<Vector3, 3>& p) {
  constexpr double none = std::numeric_limits<double>::infinity();
  const Vector3 d = b - a, u = p[1] - p[0], v = p[2] - p[0], across = d.cross(v); // [Moeller and Trumbore 1997]
  const double determinant = u.dot(across);
  if (std::abs(determinant) <= 1e-14 * d.norm() * u.norm() * v.norm())
    return none;
  const Vector3 from = a - p[0];
  const double s = from.dot(across) / determinant;
  const Vector3 q = from.cross(u);
  const double t = d.dot(q) / determinant, place = v.dot(q) / determinant;
  constexpr double slack = 1e-9; // a ray through an edge meets one of its triangles
  return s >= -slack && t >= -slack && s + t <= 1 + slack && place >= 0 && place <= 1 ? place : none;
}

class RayCaster {
 public:
  explicit RayCaster(const SurfaceMesh& mesh) : mesh_(mesh) {
    triangles_.reserve(mesh.triangles.size());
    for (const Triangle& t : mesh.triangles)
      triangles_.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    tree_ = BoxTree(triangles_, 0);
    size_ = bounds(mesh).extent().norm();
  }

  /// From a place of the surface with that normal, along `direction`, as far as `reach`; adds what it meets.
  void cast(const Vector3& place, const Vector3& normal, const Vector3& direction, double reach, double area,
            std::vector<WidthSample>& samples) const {
    const Vector3 start = place + off_surface * size_ * direction, end = place + reach * direction;
    double nearest = std::numeric_limits<double>::infinity();
    int met = -1;
    (void)tree_.any_on_segment(start, end, [&](int at) { // never ends the search: the nearest counts
      const int t = tree_.order()[static_cast<std::size_t>(at)];
      if (const double along = meeting_place(start, end, triangles_[static_cast<std::size_t>(t)]); along < nearest) {
        nearest = along;
        met = t;
      }
      return false;
    });
    if (met < 0)
      return;
    const Vector3 there = start + nearest * (end - start);
    samples.push_back(
        {0.5 * (place + there), (there - place).norm(), area, triangle_normal(mesh_, met).dot(normal) < -parallel});
  }

  [[nodiscard]] double size() const { return size_; }

 private:
  const SurfaceMesh& mesh_;
  std::vector<std::array<Vector3, 3>> triangles_;
  BoxTree tree_;
  double size_ = 0;
};

/// visit(u, v) for a place in each of the parts, `parts` along an edge, that a triangle with sides u and v is divided
/// into; off the middles of the parts, where rays would meet edges of a regular mesh.
template <class Visit>
void for_each_part(int parts, const Visit& visit) {
  constexpr double third = 1.0 / 3, aside = 0.01;
  for (int i = 0; i < parts; ++i)
    for (int k = 0; i + k < parts; ++k) {
      visit((i + third + aside) / parts, (k + third) / parts);
      if (i + k + 1 < parts)
        visit((i + 2.0 / 3 - aside) / parts, (k + 2.0 / 3) / parts);
    }
}

} // namespace

SurfaceWidths surface_widths(const SurfaceMesh& mesh, double apart, double reach) {
  const RayCaster rays(mesh);
  const double whole = area(mesh);
  const double each = std::max(apart * apart, whole / most_rays); // m2
  SurfaceWidths widths;
  double owed = 0.5 * each; // of a ray, carried from triangle to triangle
  for (int t = 0; t < std::ssize(mesh.triangles); ++t) {
    const Triangle& corners = mesh.triangles[static_cast<std::size_t>(t)];
    const Vector3 &a = mesh.vertices[corners[0]], ab = mesh.vertices[corners[1]] - a,
                  ac = mesh.vertices[corners[2]] - a;
    const Vector3 normal = triangle_normal(mesh, t);
    owed += 0.5 * ab.cross(ac).norm();
    // Parts of a large triangle, alike; a small one has a ray when it is its turn.
    const int wanted = static_cast<int>(owed / each);
    if (wanted == 0)
      continue;
    owed -= wanted * each;
    const int parts = static_cast<int>(std::ceil(std::sqrt(wanted)));
    const double share = wanted * each / (parts * parts);
    for_each_part(parts, [&](double u, double v) {
      const Vector3 x = a + u * ab + v * ac;
      rays.cast(x, normal, -normal, 2 * rays.size(), share, widths.walls);
      rays.cast(x, normal, normal, reach, share, widths.gaps);
    });
  }
  return widths;
}

class SurfaceRays::Caster : public RayCaster {
 public:
  using RayCaster::RayCaster;
};

SurfaceRays::SurfaceRays(const SurfaceMesh& mesh) : caster_(std::make_unique<const Caster>(mesh)) {}
SurfaceRays::~SurfaceRays() = default;

std::optional<WidthSample> SurfaceRays::meet(const Vector3& place, const Vector3& normal, const Vector3& direction,
                                             double reach) const {
  std::vector<WidthSample> met;
  caster_->cast(place, normal, direction, reach, 0, met);
  return met.empty() ? std::nullopt : std::optional(met.front());
}

std::vector<Vector3> places_of_triangle(const SurfaceMesh& mesh, int triangle,
                                        const std::function<double(const Vector3&)>& apart) {
  constexpr int most_parts = 200;
  const Triangle& corners = mesh.triangles[static_cast<std::size_t>(triangle)];
  const Vector3 &a = mesh.vertices[corners[0]], &b = mesh.vertices[corners[1]], &c = mesh.vertices[corners[2]];
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  const double step = std::min({apart(a), apart(b), apart(c), apart((a + b + c) / 3)});
  const int parts = std::clamp(static_cast<int>(std::ceil(longest / step)), 1, most_parts);
  std::vector<Vector3> places;
  for_each_part(parts, [&](double u, double v) { places.emplace_back(a + u * (b - a) + v * (c - a)); });
  return places;
}

std::vector<int> thin_samples(const std::vector<WidthSample>& samples, double width) {
  std::vector<int> thin;
  if (samples.empty())
    return thin;
  std::vector<Vector3> points;
  points.reserve(samples.size());
  for (const WidthSample& sample : samples)
    points.push_back(sample.point);
  const PointTree tree(points);
  std::vector<PointTree::Found> near;
  for (int s = 0; s < std::ssize(samples); ++s) {
    const WidthSample& sample = samples[static_cast<std::size_t>(s)];
    if (!(sample.width < width) || !sample.is_parallel)
      continue;
    near.clear();
    tree.within(sample.point, surroundings * width, near);
    double whole = 0, as_thin = 0;
    for (const PointTree::Found& other : near) {
      const WidthSample& beside = samples[static_cast<std::size_t>(other.index)];
      whole += beside.area;
      as_thin += beside.width < width ? beside.area : 0;
    }
    if (as_thin >= mostly * whole)
      thin.push_back(s);
  }
  return thin;
}

} // namespace spherecut::topology
