#include "topology/incision/cut_sheets.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/organ/surface_check.hpp"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Delaunay_mesh_face_base_2.h>
#include <CGAL/Delaunay_mesh_size_criteria_2.h>
#include <CGAL/Delaunay_mesh_vertex_base_2.h>
#include <CGAL/Delaunay_mesher_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_2_algorithms.h>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <string_view>
#include <unordered_map>

namespace spherecut::topology {

namespace {

void require_positive(double value, std::string_view what) {
  if (!(std::isfinite(value) && value > 0))
    throw InputError(fmt::format("sheet: {} = {} m, must be a positive number", what, value));
}

void require_edge(double edge, double smallest_size, double area) {
  require_positive(edge, "edge");
  if (edge > smallest_size)
    throw InputError(
        fmt::format("sheet: edge = {} m is longer than the sheet's smallest size, {} m", edge, smallest_size));
  constexpr double most_triangles = 1e6;
  if (const double triangles = area / (0.43 * edge * edge); triangles > most_triangles)
    throw InputError(fmt::format("sheet: edge = {} m would make {:.3g} triangles, at most {:.0g} are allowed", edge,
                                 triangles, most_triangles));
}

void require_finite(const Vector3& x, std::string_view what) {
  if (!x.allFinite())
    throw InputError(fmt::format("sheet: {} = ({}, {}, {}) is not finite", what, x.x(), x.y(), x.z()));
}

Vector3 direction(const Vector3& x, std::string_view what) {
  require_finite(x, what);
  const double length = x.norm();
  if (!(length > 0 && std::isfinite(length)))
    throw InputError(fmt::format("sheet: {} = ({}, {}, {}) has no direction", what, x.x(), x.y(), x.z()));
  return x / length;
}

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_2;
using Triangulation = CGAL::Constrained_Delaunay_triangulation_2<
    Kernel, CGAL::Triangulation_data_structure_2<CGAL::Delaunay_mesh_vertex_base_2<Kernel>,
                                                 CGAL::Delaunay_mesh_face_base_2<Kernel>>>;

/// Corners as a plane: their mean, unit normal by Newell's sums, and two axes.
struct CornerPlane {
  Vector3 origin, normal, u, v;
  double size; // m, largest distance of a corner from the mean
};

CornerPlane plane_of(const std::vector<Vector3>& corners) {
  const int count = static_cast<int>(corners.size());
  if (count < 3)
    throw InputError(fmt::format("sheet: a polygon of {} corners, at least 3 are needed", count));
  CornerPlane plane{Vector3::Zero(), Vector3::Zero(), {}, {}, 0};
  for (int i = 0; i < count; ++i) {
    require_finite(corners[i], fmt::format("corner {}", i + 1));
    plane.origin += corners[i] / count;
  }
  for (int i = 0; i < count; ++i) {
    plane.size = std::max(plane.size, (corners[i] - plane.origin).norm());
    plane.normal += (corners[i] - plane.origin).cross(corners[(i + 1) % count] - plane.origin);
  }
  if (!(plane.normal.norm() > 1e-9 * plane.size * plane.size))
    throw InputError(fmt::format("sheet: the {} corners of the polygon enclose no area", count));
  plane.normal.normalize();
  plane.u = plane.normal.unitOrthogonal();
  plane.v = plane.normal.cross(plane.u);
  constexpr double flatness = 1e-6;
  for (int i = 0; i < count; ++i) {
    if (const double off = plane.normal.dot(corners[i] - plane.origin); std::abs(off) > flatness * plane.size)
      throw InputError(
          fmt::format("sheet: corner {} of the polygon lies {:.3g} m off the plane of the others, at most {:.3g} "
                      "m are allowed",
                      i + 1, std::abs(off), flatness * plane.size));
    if (const double side = (corners[(i + 1) % count] - corners[i]).norm(); !(side > flatness * plane.size))
      throw InputError(fmt::format("sheet: corners {} and {} of the polygon coincide", i + 1, (i + 1) % count + 1));
  }
  return plane;
}

} // namespace

SurfaceMesh make_disc_sheet(const Vector3& centre, const Vector3& normal, double radius, double edge) {
  require_finite(centre, "centre");
  require_positive(radius, "radius");
  const Vector3 n = direction(normal, "normal");
  require_edge(edge, radius, M_PI * radius * radius);
  const Vector3 u = n.unitOrthogonal(), v = n.cross(u);
  const int rings = std::max(2, static_cast<int>(std::lround(radius / edge)));
  SurfaceMesh sheet;
  sheet.vertices.push_back(centre);
  for (int r = 1; r <= rings; ++r)
    for (int i = 0; i < 6 * r; ++i) {
      const double angle = i * M_PI / (3 * r);
      sheet.vertices.push_back(centre + radius * r / rings * (std::cos(angle) * u + std::sin(angle) * v));
    }
  const auto vertex = [](int ring, int i) { return ring == 0 ? 0 : 1 + 3 * ring * (ring - 1) + i % (6 * ring); };
  for (int r = 1; r <= rings; ++r)
    for (int sixth = 0; sixth < 6; ++sixth)
      for (int k = 0; k < r; ++k) {
        const int outer = sixth * r + k, inner = sixth * (r - 1) + k;
        sheet.triangles.push_back({vertex(r, outer), vertex(r, outer + 1), vertex(r - 1, inner)});
        if (k + 1 < r)
          sheet.triangles.push_back({vertex(r - 1, inner), vertex(r, outer + 1), vertex(r - 1, inner + 1)});
      }
  return sheet;
}

SurfaceMesh make_rectangle_sheet(const Vector3& centre, const Vector3& normal, const Vector3& up, double width,
                                 double height, double edge) {
  require_finite(centre, "centre");
  require_positive(width, "width");
  require_positive(height, "height");
  const Vector3 n = direction(normal, "normal"), given_up = direction(up, "up");
  const Vector3 in_plane = given_up - given_up.dot(n) * n;
  if (in_plane.norm() < 1e-6)
    throw InputError(fmt::format("sheet: up = ({}, {}, {}) is parallel to the normal ({}, {}, {})", up.x(), up.y(),
                                 up.z(), normal.x(), normal.y(), normal.z()));
  require_edge(edge, std::min(width, height), width * height);
  const Vector3 v = in_plane.normalized(), u = v.cross(n); // u x v = n
  const int columns = std::max(2, static_cast<int>(std::lround(width / edge)));
  const int rows = std::max(2, static_cast<int>(std::lround(height / edge)));
  SurfaceMesh sheet;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i)
      sheet.vertices.push_back(centre + (double(i) / columns - 0.5) * width * u +
                               (double(j) / rows - 0.5) * height * v);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int a = j * (columns + 1) + i, b = a + 1, d = a + columns + 1, c = d + 1;
      // The diagonal of a corner starts at the corner.
      if ((2 * i < columns) == (2 * j < rows)) {
        sheet.triangles.push_back({a, b, c});
        sheet.triangles.push_back({a, c, d});
      } else {
        sheet.triangles.push_back({a, b, d});
        sheet.triangles.push_back({b, c, d});
      }
    }
  return sheet;
}

SurfaceMesh make_polygon_sheet(const std::vector<Vector3>& corners, double edge) {
  const CornerPlane plane = plane_of(corners);
  std::vector<Point> outline;
  for (const Vector3& x : corners)
    outline.emplace_back(plane.u.dot(x - plane.origin), plane.v.dot(x - plane.origin));
  if (!CGAL::is_simple_2(outline.begin(), outline.end(), Kernel()))
    throw InputError(fmt::format("sheet: sides of the polygon of {} corners cross or touch", corners.size()));
  require_edge(edge, 2 * plane.size,
               std::abs(CGAL::to_double(CGAL::polygon_area_2(outline.begin(), outline.end(), Kernel()))));

  Triangulation triangulation;
  const int count = static_cast<int>(outline.size());
  for (int i = 0; i < count; ++i) {
    const Point &from = outline[i], &to = outline[(i + 1) % count];
    const int pieces = std::max(1, static_cast<int>(std::lround(std::sqrt(CGAL::squared_distance(from, to)) / edge)));
    for (int k = 0; k < pieces; ++k)
      triangulation.insert_constraint(from + double(k) / pieces * (to - from),
                                      k + 1 == pieces ? to : from + double(k + 1) / pieces * (to - from));
  }
  // Angles of 20.7 degrees and more, where the polygon's own corners allow it.
  CGAL::refine_Delaunay_mesh_2(triangulation, CGAL::Delaunay_mesh_size_criteria_2<Triangulation>(0.125, 1.2 * edge));

  SurfaceMesh sheet;
  std::unordered_map<Triangulation::Vertex_handle, int> index;
  for (const auto face : triangulation.finite_face_handles()) {
    if (!face->is_in_domain())
      continue;
    Triangle t{};
    for (int i = 0; i < 3; ++i) {
      const auto [found, is_new] = index.emplace(face->vertex(i), static_cast<int>(sheet.vertices.size()));
      if (is_new)
        sheet.vertices.push_back(plane.origin + face->vertex(i)->point().x() * plane.u +
                                 face->vertex(i)->point().y() * plane.v);
      t[i] = found->second;
    }
    sheet.triangles.push_back(t);
  }
  split_bridges(sheet);
  check_sheet(sheet, "sheet of the polygon");
  return sheet;
}

SurfaceMesh read_sheet(const std::filesystem::path& file, double scale_to_metres, std::vector<std::string>* mended) {
  CheckedSurface checked = check_sheet_surface(read_polygons(file, scale_to_metres), file.string());
  check_sheet(checked.mesh, file.string());
  split_bridges(checked.mesh);
  if (mended != nullptr)
    mended->insert(mended->end(), checked.mended.begin(), checked.mended.end());
  return std::move(checked.mesh);
}

int split_bridges(SurfaceMesh& sheet) {
  const auto neighbours = triangle_neighbours(sheet);
  std::vector<bool> border(sheet.vertices.size(), false);
  for (int t = 0; t < std::ssize(sheet.triangles); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0)
        border[sheet.triangles[t][e]] = border[sheet.triangles[t][(e + 1) % 3]] = true;
  // The new vertex of each split edge, known to both of its triangles.
  std::vector<std::array<int, 3>> middle(sheet.triangles.size(), {-1, -1, -1});
  int splits = 0;
  for (int t = 0; t < std::ssize(sheet.triangles); ++t)
    for (int e = 0; e < 3; ++e) {
      const int from = sheet.triangles[t][e], to = sheet.triangles[t][(e + 1) % 3], other = neighbours[t][e];
      if (other < t || !border[from] || !border[to])
        continue;
      for (int f = 0; f < 3; ++f)
        if (sheet.triangles[other][f] == to && sheet.triangles[other][(f + 1) % 3] == from)
          middle[other][f] = static_cast<int>(sheet.vertices.size());
      middle[t][e] = static_cast<int>(sheet.vertices.size());
      sheet.vertices.push_back(0.5 * (sheet.vertices[from] + sheet.vertices[to]));
      ++splits;
    }
  if (splits == 0)
    return 0;
  std::vector<Triangle> divided;
  for (int t = 0; t < std::ssize(sheet.triangles); ++t) {
    switch (std::count_if(middle[t].begin(), middle[t].end(), [](int vertex) { return vertex >= 0; })) {
    case 3:
      divided.push_back({middle[t][0], middle[t][1], middle[t][2]});
      for (int e = 0; e < 3; ++e)
        divided.push_back({sheet.triangles[t][e], middle[t][e], middle[t][(e + 2) % 3]});
      break;
    case 2: { // turned so that the side without a new vertex comes first
      const int whole = static_cast<int>(std::find(middle[t].begin(), middle[t].end(), -1) - middle[t].begin());
      const int a = sheet.triangles[t][whole], b = sheet.triangles[t][(whole + 1) % 3];
      const int c = sheet.triangles[t][(whole + 2) % 3];
      const int on_bc = middle[t][(whole + 1) % 3], on_ca = middle[t][(whole + 2) % 3];
      divided.push_back({a, b, on_bc});
      divided.push_back({a, on_bc, on_ca});
      divided.push_back({on_bc, c, on_ca});
      break;
    }
    case 1: {
      const int split = middle[t][0] >= 0 ? 0 : middle[t][1] >= 0 ? 1 : 2;
      const int a = sheet.triangles[t][split], b = sheet.triangles[t][(split + 1) % 3];
      const int c = sheet.triangles[t][(split + 2) % 3];
      divided.push_back({a, middle[t][split], c});
      divided.push_back({middle[t][split], b, c});
      break;
    }
    default:
      divided.push_back(sheet.triangles[t]);
    }
  }
  sheet.triangles = std::move(divided);
  return splits;
}

} // namespace spherecut::topology
