// Notation: x_i node, h_i its spacing (the cell is built in units of h_i about x_i, because voro++ has absolute
// tolerances), phi = curved_distance. Faces are taken from the cell of the smaller index only, so that each polygon is
// cut once and shared with opposite signs.
#include "topology/cells/voronoi_cells.hpp"

#include "topology/base/errors.hpp"
#include "topology/cells/cell_clipper.hpp"
#include "topology/cells/facet_clipper.hpp"
#include "topology/incision/lip_lift.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <voro++.hh>

namespace spherecut::topology {

namespace {

constexpr double cell_reach = 6;        // half size of the initial box of a cell, in h
constexpr double first_reach = 2.0;     // from a node, within which others are looked for first, in h
constexpr double beside = 1.5;          // a surface this near to a node cuts its cell before the neighbours do, in h
constexpr double cap_height = 0.75;     // how far outside the curved surface a cell is cut off, in h
constexpr double notch = 1.2;           // a concave edge this near to a node leaves no cap above it, in h
constexpr double lip_reach = 0.01;      // a node this near to a sheet lies on one of its faces, in h
constexpr double lip_lift = 0.1;        // by which it is lifted to look for its neighbours, in h
constexpr double smallest_face = 1e-12; // area of a face, in h2
constexpr double sliver = 1e-3;         // a smaller part of a face is not split off it
constexpr int first_plane_id = -100;
constexpr int cap_id = -50;

void append_corners(const std::vector<Vector3>& polygon, const Vector3& node, double spacing,
                    std::vector<Vector3>& corners, std::vector<int>& start) {
  for (const Vector3& vertex : polygon)
    corners.push_back(node + spacing * vertex);
  start.push_back(static_cast<int>(corners.size()));
}

/// One cell under construction.
struct CellBuilder {
  const std::vector<Vector3>& nodes;
  const std::vector<double>& spacings;
  const Domain& domain;
  const PointTree& tree;
  const Incision* incision;
  const std::vector<Vector3>& lookouts; // of the nodes, when there is an incision
  bool curved;
  const SurfaceFacets* surface; // null: it is curved
  std::vector<PointTree::Found> near;
  std::vector<double> vertices;
  std::vector<int> face_vertices, neighbours;
  std::vector<double> vertex_phi;
  voro::voronoicell_neighbor cell; // kept: a new one asks for many blocks of memory

  void build(int i, CellComplex& cells, std::vector<Vector3>& closure);

 private:
  /// A face of the cell of node i within the body, relative to it in units of its spacing.
  void add_face(int i, int neighbour, const std::vector<Vector3>& polygon, CellComplex& cells,
                std::vector<Vector3>& closure);
  /// The parts of the surface in the cell of node i, smooth piece by smooth piece; false when there are none.
  bool add_patches(int i, const FacetClipper& facets, CellComplex& cells);
  /// A face between nodes that do not see each other, a polygon relative to node i in units of its spacing: what lies
  /// ahead of the front is an ordinary face.
  void add_lip(int i, int j, const std::vector<Vector3>& polygon, const Vector3& outward, CellComplex& cells,
               std::vector<Vector3>& closure) const;
  /// False when nothing is left.
  bool cut(int i);
  bool cut_by_neighbours(int i);
  /// Whether a corner lies beyond the plane half way to d, with |d| squared: half of the nodes looked at cut nothing.
  [[nodiscard]] bool reaches(const Vector3& d, double squared) const;
  /// By the planes that are `from` to `to` spacings away (from 0: outside too). False when nothing is left.
  bool cut_by_planes(const Vector3& x, double h, double from, double to);
  [[nodiscard]] bool hidden(int i, int j) const {
    int wall = -1;
    return hidden(i, j, wall);
  }
  /// Sets the triangle that hides.
  [[nodiscard]] bool hidden(int i, int j, int& wall) const {
    if (incision == nullptr)
      return false;
    const Vector3 &a = lookouts[i], &b = lookouts[j];
    return incision->near(0.5 * (a + b), 0.5001 * (b - a).norm()) && incision->blocks(a, b, wall);
  }
  /// Where a narrow gap of the body's own surface lies between two nodes: the plane of its middle, in which the cells
  /// of both end; normal from i to j.
  [[nodiscard]] std::optional<Plane> middle_of_gap(int i, int j) const {
    int wall = -1;
    if (incision == nullptr || incision->cut_sheets() == std::ssize(incision->sheets()) || !hidden(i, j, wall) ||
        incision->triangle_of(wall).first < incision->cut_sheets())
      return std::nullopt;
    const auto [sheet, triangle] = incision->triangle_of(wall);
    const SurfaceMesh& mesh = incision->sheets()[sheet];
    Vector3 normal = triangle_normal(mesh, triangle);
    if (normal.dot(lookouts[j] - lookouts[i]) < 0)
      normal = -normal;
    return Plane{normal, normal.dot(mesh.vertices[mesh.triangles[triangle][0]])};
  }
};

bool CellBuilder::reaches(const Vector3& d, double squared) const {
  for (const double *corner = cell.pts, *end = cell.pts + 3 * static_cast<std::ptrdiff_t>(cell.p); corner != end;
       corner += 3)
    if (corner[0] * d.x() + corner[1] * d.y() + corner[2] * d.z() > squared)
      return true;
  return false;
}

bool CellBuilder::cut_by_planes(const Vector3& x, double h, double from, double to) {
  for (std::size_t p = 0; p < domain.planes().size(); ++p) {
    const Plane& plane = domain.planes()[p];
    const double distance = -plane.signed_distance(x) / h;
    if ((from > 0 && distance < from) || distance >= to)
      continue;
    if (!cell.nplane(plane.normal.x(), plane.normal.y(), plane.normal.z(), 2 * distance,
                     first_plane_id - static_cast<int>(p)))
      return false;
  }
  return true;
}

bool CellBuilder::cut(int i) {
  // Planes that are not beside it mostly lie beyond its neighbours: last, where the cell still reaches them.
  return cut_by_neighbours(i) &&
         cut_by_planes(nodes[i], spacings[i], beside, 0.5 * std::sqrt(cell.max_radius_squared()) + 1e-9);
}

bool CellBuilder::cut_by_neighbours(int i) {
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  cell.init(-cell_reach, cell_reach, -cell_reach, cell_reach, -cell_reach, cell_reach);
  if (!cut_by_planes(x, h, 0, beside))
    return false;
  if (curved) {
    const double distance = -domain.curved_distance(x) / h;
    // In a notch material lies above the surface that is nearest: there the surface itself has to end the cell.
    if (distance < beside && !(surface != nullptr && surface->sharp_near(x, notch * h).concave)) {
      const Vector3 n = domain.curved_gradient(x);
      cell.nplane(n.x(), n.y(), n.z(), 2 * (distance + cap_height), cap_id);
    }
  }
  // A node farther away than twice the cell's farthest corner cuts nothing; voro++ holds corners at twice their place.
  double covered = 0, reach = first_reach; // h
  while (true) {
    near.clear();
    tree.within(x, reach * h, near);
    std::sort(near.begin(), near.end());
    int since_check = 0;
    double needed = cell.max_radius_squared();
    for (const PointTree::Found& other : near) {
      const double squared = other.squared_distance / (h * h);
      if (other.index == i || squared < covered * covered)
        continue;
      if (squared < 1e-14)
        throw InputError(
            fmt::format("nodes {} and {} coincide at ({:.6g}, {:.6g}, {:.6g}) m", i, other.index, x.x(), x.y(), x.z()));
      if (squared > needed)
        return true;
      const Vector3 d = (nodes[other.index] - x) / h;
      if (const std::optional<Plane> middle = middle_of_gap(i, other.index)) {
        const double distance = -middle->signed_distance(x) / h;
        if (reaches(middle->normal, 2 * distance) &&
            !cell.nplane(middle->normal.x(), middle->normal.y(), middle->normal.z(), 2 * distance, other.index))
          return false;
        continue;
      }
      if (!reaches(d, squared))
        continue;
      if (!cell.nplane(d.x(), d.y(), d.z(), squared, other.index))
        return false;
      if (++since_check == 4) {
        since_check = 0;
        needed = cell.max_radius_squared();
      }
    }
    const double farthest = std::sqrt(cell.max_radius_squared());
    if (farthest <= reach || near.size() == nodes.size())
      return true;
    covered = reach;
    reach = std::min(farthest * 1.01, reach * 1.6);
  }
}

/// The parts of a convex polygon before and behind the plane through `origin` with the given normal.
std::pair<std::vector<Vector3>, std::vector<Vector3>> split(const std::vector<Vector3>& polygon, const Vector3& origin,
                                                            const Vector3& normal) {
  std::pair<std::vector<Vector3>, std::vector<Vector3>> parts;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vector3 &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    const double at_a = (a - origin).dot(normal), at_b = (b - origin).dot(normal);
    (at_a >= 0 ? parts.first : parts.second).push_back(a);
    if ((at_a >= 0) != (at_b >= 0)) {
      const Vector3 crossing = a + at_a / (at_a - at_b) * (b - a);
      parts.first.push_back(crossing);
      parts.second.push_back(crossing);
    }
  }
  return parts;
}

void CellBuilder::add_lip(int i, int j, const std::vector<Vector3>& polygon, const Vector3& outward, CellComplex& cells,
                          std::vector<Vector3>& closure) const {
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  const auto measured = [&](const std::vector<Vector3>& part) {
    PolygonMeasure face = part.size() < 3 ? PolygonMeasure{} : measure(part);
    if (face.area.dot(outward) < 0)
      face.area = -face.area;
    return face;
  };
  // Straight pieces of the front near the corners take their parts off one by one.
  std::vector<Vector3> behind = polygon;
  std::vector<Vector3> cuts; // directions of growth
  std::vector<Vector3> places;
  const Vector3 middle = measure(polygon).centroid;
  double reach = 0;
  for (const Vector3& corner : polygon)
    reach = std::max(reach, (corner - middle).norm());
  const auto add_front = [&](const Vector3& corner) {
    const auto front = incision->front_frame(x + h * corner, h * reach);
    if (front &&
        std::none_of(cuts.begin(), cuts.end(), [&](const Vector3& cut) { return cut.dot(front->ahead) > 0.95; })) {
      cuts.push_back(front->ahead);
      places.push_back((front->point - x) / h);
    }
  };
  add_front(middle);
  for (const Vector3& corner : polygon)
    add_front(corner);
  const double smallest = sliver * measure(polygon).area.norm();
  for (std::size_t c = 0; c < cuts.size(); ++c) {
    auto [ahead, rest] = split(behind, places[c], cuts[c]);
    const PolygonMeasure face = measured(ahead);
    if (face.area.norm() < smallest)
      continue;
    const Vector3 centroid = x + h * face.centroid;
    if (incision->blocks(x, centroid) || incision->blocks(nodes[j], centroid))
      continue;
    const bool all = measured(rest).area.norm() < smallest;
    const PolygonMeasure& joined = all ? measured(behind) : face;
    cells.faces.push_back({i, j, joined.area * h * h, x + h * joined.centroid});
    append_corners(all ? behind : ahead, x, h, cells.face_corners, cells.face_start);
    closure[i] += joined.area * h * h;
    closure[j] -= joined.area * h * h;
    if (all)
      return;
    behind = std::move(rest);
  }
  const PolygonMeasure lip = measured(behind);
  const Vector3 area = lip.area * h * h, centroid = x + h * lip.centroid;
  cells.lips.push_back({i, j, area, centroid});
  cells.lips.push_back({j, i, -area, centroid});
  append_corners(behind, x, h, cells.lip_corners, cells.lip_start);
  closure[i] += area;
  closure[j] -= area;
}

void CellBuilder::build(int i, CellComplex& cells, std::vector<Vector3>& closure) {
  if (!cut(i))
    return;
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  cell.vertices(vertices);
  cell.face_vertices(face_vertices);
  cell.neighbors(neighbours);
  const int vertex_count = static_cast<int>(vertices.size() / 3);
  const auto vertex = [&](int v) { return Vector3(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]); };

  CurvedClipper clipper(domain, x, h);
  vertex_phi.assign(vertex_count, -1);
  bool near_surface = false;
  std::optional<FacetClipper> facets; // of a cell at a sharp edge
  if (curved) {
    // phi is 1-Lipschitz: a cell whose radius is less than its depth below the surface cannot meet it.
    const double depth = -domain.curved_distance(x) / h, radius = std::sqrt(0.25 * cell.max_radius_squared());
    near_surface = depth < radius * 1.0001;
    if (near_surface) {
      for (int v = 0; v < vertex_count; ++v)
        vertex_phi[v] = clipper.phi(vertex(v));
      if (surface != nullptr && surface->sharp_near(x, radius * h).any) {
        std::vector<Vector3> corners;
        corners.reserve(vertex_count);
        for (int v = 0; v < vertex_count; ++v)
          corners.push_back(vertex(v));
        facets.emplace(*surface, x, h, corners);
      }
    }
  }

  std::size_t position = 0;
  CellPolygon polygon;
  for (const int neighbour : neighbours) {
    const int size = face_vertices[position++];
    if (!near_surface && neighbour >= 0 && neighbour < i) {
      position += size; // had from there
      continue;
    }
    polygon.vertices.clear();
    polygon.phi.clear();
    for (int k = 0; k < size; ++k) {
      const int v = face_vertices[position++];
      polygon.vertices.push_back(vertex(v));
      polygon.phi.push_back(vertex_phi[v]);
    }
    if (neighbour < 0 && neighbour > first_plane_id) {
      if (neighbour > cap_id && (!near_surface || CurvedClipper(domain, x, h).clip(polygon)))
        throw InputError(fmt::format("the cell of node {} at ({:.6g}, {:.6g}, {:.6g}) m reaches farther than {} times "
                                     "its spacing {:.3g} m inside the body: the nodes leave a hole there",
                                     i, x.x(), x.y(), x.z(), cell_reach, h));
      continue; // the cap or the box: outside the body
    }
    const Vector3 whole = measure(polygon.vertices).area;
    const double deepest = *std::min_element(polygon.phi.begin(), polygon.phi.end());
    const double highest = *std::max_element(polygon.phi.begin(), polygon.phi.end());
    const auto loops =
        facets && whole.norm() > smallest_face ? facets->inside(polygon.vertices, deepest + highest < 0) : std::nullopt;
    if (loops) {
      for (const std::vector<Vector3>& loop : *loops)
        if (loop.size() >= 3 && measure(loop).area.dot(whole) > 0) // not a hole within a face
          add_face(i, neighbour, loop, cells, closure);
    } else if (!near_surface || clipper.clip(polygon)) {
      add_face(i, neighbour, polygon.vertices, cells, closure);
    }
  }
  if (facets && add_patches(i, *facets, cells))
    return;
  if (clipper.met_surface()) {
    // Area follows from closure, once every face is known; the place is the mean crossing projected on the surface.
    Vector3 point = x + h * clipper.surface_mean();
    for (int iteration = 0; iteration < 2; ++iteration)
      point -= domain.curved_distance(point) * domain.curved_gradient(point);
    cells.boundary.push_back({i, -1, Vector3::Zero(), point});
    cells.boundary_start.push_back(static_cast<int>(cells.boundary_corners.size()));
  }
}

void CellBuilder::add_face(int i, int neighbour, const std::vector<Vector3>& polygon, CellComplex& cells,
                           std::vector<Vector3>& closure) {
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  PolygonMeasure face = polygon.size() < 3 ? PolygonMeasure{} : measure(polygon);
  if (face.area.norm() < smallest_face)
    return;
  const bool planar_boundary = neighbour <= first_plane_id;
  // Outward from the node. A plane through the node itself is a part of the boundary: its own normal tells.
  const Vector3 outward =
      planar_boundary ? domain.planes()[first_plane_id - neighbour].normal : Vector3(nodes[neighbour] - x);
  if (face.area.dot(outward) < 0)
    face.area = -face.area;
  const Vector3 area = face.area * h * h, centroid = x + h * face.centroid;
  if (planar_boundary) {
    cells.boundary.push_back({i, first_plane_id - neighbour, area, centroid});
    append_corners(polygon, x, h, cells.boundary_corners, cells.boundary_start);
    closure[i] += area;
  } else if (neighbour < i) {
    return; // had from there
  } else if (middle_of_gap(i, neighbour)) {
    // In the gap there is nothing; beside its end the two meet in the material.
    if (incision->blocks(x, centroid) || incision->blocks(nodes[neighbour], centroid))
      return;
    cells.faces.push_back({i, neighbour, area, centroid});
    append_corners(polygon, x, h, cells.face_corners, cells.face_start);
    closure[i] += area;
    closure[neighbour] -= area;
  } else if (hidden(i, neighbour)) {
    add_lip(i, neighbour, polygon, outward, cells, closure);
  } else {
    cells.faces.push_back({i, neighbour, area, centroid});
    append_corners(polygon, x, h, cells.face_corners, cells.face_start);
    closure[i] += area;
    closure[neighbour] -= area;
  }
}

bool CellBuilder::add_patches(int i, const FacetClipper& facets, CellComplex& cells) {
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  std::vector<Plane> planes;
  std::size_t position = 0;
  std::vector<Vector3> corners;
  for (std::size_t f = 0; f < neighbours.size(); ++f) {
    const int size = face_vertices[position++];
    corners.clear();
    for (int k = 0; k < size; ++k) {
      const int v = face_vertices[position++];
      corners.emplace_back(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]);
    }
    const PolygonMeasure face = measure(corners);
    const double area = face.area.norm();
    if (area < smallest_face)
      continue;
    Vector3 normal = face.area / area;
    if (normal.dot(face.centroid) < 0) // from the node, which lies within the cell
      normal = -normal;
    planes.push_back({normal, normal.dot(face.centroid)});
  }
  const std::vector<FacetPatch> patches = facets.within(planes);
  for (const FacetPatch& patch : patches) {
    cells.boundary.push_back({i, -1, patch.area * h * h, x + h * patch.centroid});
    cells.boundary_start.push_back(static_cast<int>(cells.boundary_corners.size()));
  }
  return !patches.empty();
}

/// The two nodes of a lip pair as mirror images about the tangent plane of their sheet: on a surface that the sheet
/// meets at a slant they are not, and the face between their cells would lie askew. Moves nodes by at most their
/// distance from the sheet.
std::vector<Vector3> mirrored_lips(const std::vector<Vector3>& nodes, const std::vector<double>& spacings,
                                   const Incision& incision) {
  std::vector<int> lips;
  std::vector<Vector3> places;
  for (int i = 0; i < std::ssize(nodes); ++i)
    if (incision.near(nodes[i], lip_reach * spacings[i])) {
      lips.push_back(i);
      places.push_back(nodes[i]);
    }
  std::vector<Vector3> sites = nodes;
  const PointTree tree(places);
  std::vector<PointTree::Found> found;
  for (const int i : lips) {
    found.clear();
    tree.within(nodes[i], lip_reach * spacings[i], found);
    std::sort(found.begin(), found.end());
    for (const PointTree::Found& other : found) {
      const int j = lips[other.index];
      if (j == i || !incision.blocks(nodes[i], nodes[j]))
        continue;
      if (j < i) // done from there
        break;
      const Vector3 middle = 0.5 * (nodes[i] + nodes[j]);
      const auto sheet = incision.closest(middle, lip_reach * spacings[i]);
      if (sheet && sheet->sheet < incision.cut_sheets()) {
        const double height = 0.5 * (nodes[i] - nodes[j]).dot(sheet->normal);
        sites[i] = sheet->point + height * sheet->normal;
        sites[j] = sheet->point - height * sheet->normal;
      }
      break;
    }
  }
  return sites;
}

/// Volumes, centroids and reaches by cones from the nodes over the faces.
void measure_cells(CellComplex& cells) {
  const std::vector<Vector3>& nodes = cells.sites;
  cells.volumes.assign(nodes.size(), 0.0);
  cells.centroids.assign(nodes.size(), Vector3::Zero());
  cells.reaches.assign(nodes.size(), 0.0);
  const auto add_cone = [&](int i, const Vector3& area, const Vector3& centroid) {
    const Vector3 arm = centroid - nodes[i];
    const double cone = arm.dot(area) / 3;
    cells.volumes[i] += cone;
    cells.centroids[i] += cone * 0.75 * arm;
  };
  const auto reach = [&](int i, const std::vector<Vector3>& corners, const std::vector<int>& start, std::size_t k) {
    for (int c = start[k]; c < start[k + 1]; ++c)
      cells.reaches[i] = std::max(cells.reaches[i], (corners[c] - nodes[i]).norm());
  };
  for (std::size_t f = 0; f < cells.faces.size(); ++f) {
    const CellFace& face = cells.faces[f];
    add_cone(face.first, face.area, face.centroid);
    add_cone(face.second, -face.area, face.centroid);
    reach(face.first, cells.face_corners, cells.face_start, f);
    reach(face.second, cells.face_corners, cells.face_start, f);
  }
  for (std::size_t l = 0; l < cells.lips.size(); ++l) {
    add_cone(cells.lips[l].node, cells.lips[l].area, cells.lips[l].centroid);
    reach(cells.lips[l].node, cells.lip_corners, cells.lip_start, l / 2);
  }
  for (std::size_t b = 0; b < cells.boundary.size(); ++b) {
    const BoundaryFace& face = cells.boundary[b];
    add_cone(face.node, face.area, face.centroid);
    reach(face.node, cells.boundary_corners, cells.boundary_start, b);
    cells.reaches[face.node] = std::max(cells.reaches[face.node], (face.centroid - nodes[face.node]).norm());
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (cells.volumes[i] > 0) {
      cells.centroids[i] = nodes[i] + cells.centroids[i] / cells.volumes[i];
    } else {
      cells.centroids[i] = nodes[i];
      ++cells.empty_cells;
    }
  }
}

/// The cells of cells.sites, which stand at `places` or, in lip pairs, beside them.
void build_cells(const std::vector<Vector3>& places, const std::vector<double>& spacings, const Domain& domain,
                 const Incision* incision, CellComplex& cells) {
  const std::vector<Vector3>& nodes = cells.sites;
  const int count = static_cast<int>(nodes.size());
  std::vector<Vector3> closure(nodes.size(), Vector3::Zero());
  std::vector<Vector3> lookouts(incision == nullptr ? 0 : nodes.size());
  for (std::size_t i = 0; i < lookouts.size(); ++i)
    lookouts[i] = lift_off(*incision, places[i], lip_reach * spacings[i], lip_lift * spacings[i]);
  const PointTree tree(nodes);
  const bool curved = count > 0 && std::isfinite(domain.curved_distance(nodes.front()));
  CellBuilder builder{nodes, spacings, domain, tree, incision, lookouts, curved, facets_of(domain),
                      {},    {},       {},     {},   {},       {}};
  for (int i = 0; i < count; ++i)
    builder.build(i, cells, closure);
  std::vector<char> on_curve(nodes.size(), 0);
  // What is left open is the part on the curve.
  std::vector<Vector3> parts(nodes.size(), Vector3::Zero());
  std::vector<double> sizes(nodes.size(), 0);
  for (const BoundaryFace& face : cells.boundary)
    if (face.plane < 0) {
      parts[face.node] += face.area;
      sizes[face.node] += face.area.norm();
      on_curve[face.node] = 1;
    }
  for (BoundaryFace& face : cells.boundary)
    if (face.plane < 0) {
      const double share = sizes[face.node] > 0 ? face.area.norm() / sizes[face.node] : 1;
      face.area -= share * (closure[face.node] + parts[face.node]);
    }
  // The surface can leave a cell exactly through its edges, without a crossing: closure still tells.
  for (int i = 0; curved && i < count; ++i)
    if (on_curve[i] == 0 && closure[i].norm() > 1e-9 * spacings[i] * spacings[i]) {
      cells.boundary.push_back({i, -1, -closure[i], domain.closest_surface_point(nodes[i])});
      cells.boundary_start.push_back(static_cast<int>(cells.boundary_corners.size()));
    }
  measure_cells(cells);
}

void reserve(CellComplex& cells, std::size_t nodes) {
  constexpr std::size_t faces = 8, corners = 6; // a node; a face
  cells.faces.reserve(faces * nodes);
  cells.face_start.reserve(faces * nodes + 1);
  cells.face_corners.reserve(corners * faces * nodes);
}

} // namespace

CellComplex voronoi_cells(const std::vector<Vector3>& nodes, const std::vector<double>& spacings, const Domain& domain,
                          const Incision* incision) {
  CellComplex cells;
  cells.sites = incision == nullptr ? nodes : mirrored_lips(nodes, spacings, *incision);
  reserve(cells, nodes.size());
  build_cells(nodes, spacings, domain, incision, cells);
  return cells;
}

} // namespace spherecut::topology
