#include "src/model/precut_sheets.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::app {
namespace {

/// Part of a rectangle's side, from `lower` to `upper` along `axis` from its centre, that is near the body.
std::array<double, 2> part_near(const topology::Domain& domain, const Vector3& centre, const Vector3& axis, double half,
                                double beside) {
  const BoundingBox box = domain.bounds();
  double lower = std::numeric_limits<double>::infinity(), upper = -lower;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 x((corner & 1) != 0 ? box.upper.x() : box.lower.x(),
                    (corner & 2) != 0 ? box.upper.y() : box.lower.y(),
                    (corner & 4) != 0 ? box.upper.z() : box.lower.z());
    lower = std::min(lower, axis.dot(x - centre));
    upper = std::max(upper, axis.dot(x - centre));
  }
  return {std::max(-half, lower - beside), std::min(half, upper + beside)};
}

topology::SurfaceMesh rectangle_sheet(const RectangleSheet& rectangle, const topology::Domain& domain, double edge) {
  constexpr double beside = 2; // edges
  const auto make = [&](const Vector3& centre, double width, double height) {
    return topology::make_rectangle_sheet(centre, rectangle.normal, rectangle.up, width, height,
                                          std::min({edge, width / 4, height / 4}));
  };
  const Vector3 normal = rectangle.normal.normalized();
  const Vector3 up = (rectangle.up - rectangle.up.dot(normal) * normal).normalized(), along = up.cross(normal);
  if (!up.allFinite() || !along.allFinite())
    return make(rectangle.centre, rectangle.width, rectangle.height);
  // Places on the plane in numbers that do not depend, by rounding, on where the centre of the rectangle is.
  const Vector3 middle = domain.bounds().centre();
  const double grain = 1e-9 * domain.bounds().extent().norm();
  const auto settled = [&](double place) { return std::round(place / grain) * grain; };
  const auto [left, right] = part_near(domain, rectangle.centre, along, 0.5 * rectangle.width, beside * edge);
  const auto [bottom, top] = part_near(domain, rectangle.centre, up, 0.5 * rectangle.height, beside * edge);
  const bool is_whole = right - left >= rectangle.width && top - bottom >= rectangle.height;
  if (is_whole || !(right > left && top > bottom))
    return make(rectangle.centre, rectangle.width, rectangle.height);
  const Vector3 from_middle = rectangle.centre - middle;
  const double off = settled(from_middle.dot(normal));
  const double l = settled(left + from_middle.dot(along)), r = settled(right + from_middle.dot(along));
  const double b = settled(bottom + from_middle.dot(up)), t = settled(top + from_middle.dot(up));
  return make(middle + off * normal + 0.5 * (l + r) * along + 0.5 * (b + t) * up, r - l, t - b);
}

} // namespace

// A sheet smaller than the triangles wanted gets four of them across.
topology::SurfaceMesh precut_sheet(const PrecutSettings& precut, const topology::Domain& domain, double edge,
                                   std::vector<std::string>* remarks) {
  if (const auto* disc = std::get_if<DiscSheet>(&precut.shape))
    return topology::make_disc_sheet(disc->centre, disc->normal, disc->radius, std::min(edge, disc->radius / 2));
  if (const auto* rectangle = std::get_if<RectangleSheet>(&precut.shape))
    return rectangle_sheet(*rectangle, domain, edge);
  if (const auto* polygon = std::get_if<PolygonSheet>(&precut.shape)) {
    for (std::size_t i = 0; i < polygon->points.size(); ++i)
      edge = std::min(edge, (polygon->points[i] - polygon->points[(i + 1) % polygon->points.size()]).norm());
    return topology::make_polygon_sheet(polygon->points, edge);
  }
  const auto& file = std::get<SheetFile>(precut.shape);
  return topology::read_sheet(file.file, file.scale, remarks);
}

int end_on_surface(topology::SurfaceMesh& sheet, const topology::Domain& domain, double within) {
  constexpr double slanted = 0.2; // sine of the least angle between sheet and surface at which this is done
  const auto neighbours = topology::triangle_neighbours(sheet);
  const std::vector<Vector3> normals = topology::vertex_normals(sheet);
  std::vector<char> is_border(sheet.vertices.size(), 0);
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0)
        is_border[sheet.triangles[t][e]] = is_border[sheet.triangles[t][(e + 1) % 3]] = 1;
  const double on_surface = 1e-9 * domain.bounds().extent().norm();
  std::vector<char> is_moved(sheet.vertices.size(), 0);
  for (std::size_t v = 0; v < sheet.vertices.size(); ++v) {
    if (is_border[v] == 0)
      continue;
    const double distance = domain.signed_distance(sheet.vertices[v]);
    if (distance >= -on_surface || distance < -within)
      continue;
    const Vector3 outward = domain.normal(sheet.vertices[v]);
    const Vector3 along = outward - outward.dot(normals[v]) * normals[v];
    if (along.norm() < slanted)
      continue;
    sheet.vertices[v] += (within - distance) / along.squaredNorm() * along;
    is_moved[v] = 1;
  }
  std::vector<char> is_end(sheet.vertices.size(), 0);
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e)
      if (const int from = sheet.triangles[t][e], to = sheet.triangles[t][(e + 1) % 3];
          neighbours[t][e] < 0 && is_moved[from] != 0 && is_moved[to] != 0)
        is_end[from] = is_end[to] = 1;
  return static_cast<int>(std::count(is_end.begin(), is_end.end(), 1));
}

} // namespace spherecut::app
