// Notation: x_i node, h_i its spacing (the cell is built in units of h_i about x_i, because voro++ has absolute
// tolerances), phi = curved_distance. Faces are taken from the cell of the smaller index only, so that each polygon is
// cut once and shared with opposite signs.
#include "topology/voronoi_cells.hpp"

#include "topology/errors.hpp"
#include "topology/lip_lift.hpp"
#include "topology/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <voro++.hh>

namespace spherecut::topology {

namespace {

constexpr double cell_reach = 6;    // half size of the initial box of a cell, in h
constexpr double cap_height = 0.75; // how far outside the curved surface a cell is cut off, in h
constexpr double lip_reach = 0.01;  // a node this near to a sheet lies on one of its faces, in h
constexpr double lip_lift = 0.1;    // by which it is lifted to look for its neighbours, in h
constexpr double sliver = 1e-3;     // a smaller part of a face is not split off it
constexpr int first_plane_id = -100;
constexpr int cap_id = -50;

struct Polygon {
  std::vector<Vector3> vertices; // relative to the node, units of h
  std::vector<double> phi;       // curved distance at the vertices, units of h
};

struct Measure {
  Vector3 area = Vector3::Zero();
  Vector3 centroid = Vector3::Zero();
};

/// Area vector and centroid of a planar polygon.
Measure measure(const std::vector<Vector3>& polygon) {
  Measure result;
  const Vector3& origin = polygon.front();
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k)
    result.area += 0.5 * (polygon[k] - origin).cross(polygon[k + 1] - origin);
  const double total = result.area.norm();
  if (total <= 0)
    return {};
  const Vector3 normal = result.area / total;
  // Signed weights: a polygon bent inwards by its arc vertices stays right.
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
    const double weight = 0.5 * (polygon[k] - origin).cross(polygon[k + 1] - origin).dot(normal);
    result.centroid += weight / total * (origin + polygon[k] + polygon[k + 1]) / 3;
  }
  return result;
}

void append_corners(const std::vector<Vector3>& polygon, const Vector3& node, double spacing,
                    std::vector<Vector3>& corners, std::vector<int>& start) {
  for (const Vector3& vertex : polygon)
    corners.push_back(node + spacing * vertex);
  start.push_back(static_cast<int>(corners.size()));
}

/// Clips polygons by phi < 0 and collects the points where they met the curved surface.
class CurvedClipper {
 public:
  CurvedClipper(const Domain& domain, const Vector3& node, double spacing)
      : domain_(domain), node_(node), spacing_(spacing) {}

  double phi(const Vector3& local) const { return domain_.curved_distance(node_ + spacing_ * local) / spacing_; }

  /// Returns false when nothing of the polygon lies inside.
  bool clip(Polygon& polygon) {
    const std::size_t count = polygon.vertices.size();
    const bool outside = std::all_of(polygon.phi.begin(), polygon.phi.end(), [](double v) { return v >= 0; });
    if (outside)
      return false;
    if (std::all_of(polygon.phi.begin(), polygon.phi.end(), [](double v) { return v < 0; }))
      return true;
    std::vector<Vector3> kept;
    Vector3 exit = Vector3::Zero();
    bool have_exit = false;
    std::size_t start = 0; // begin at an inside vertex so that every exit precedes its entry
    while (polygon.phi[start] >= 0)
      ++start;
    const Vector3 normal = measure(polygon.vertices).area.normalized();
    for (std::size_t step = 0; step < count; ++step) {
      const std::size_t k = (start + step) % count, next = (k + 1) % count;
      if (polygon.phi[k] < 0)
        kept.push_back(polygon.vertices[k]);
      if ((polygon.phi[k] < 0) == (polygon.phi[next] < 0))
        continue;
      const Vector3 crossing = root(polygon.vertices[k], polygon.phi[k], polygon.vertices[next], polygon.phi[next]);
      if (polygon.phi[k] < 0) {
        exit = crossing;
        have_exit = true;
        kept.push_back(crossing);
      } else {
        if (have_exit)
          add_arc(exit, crossing, normal, kept);
        kept.push_back(crossing);
      }
      surface_sum_ += crossing;
      ++surface_count_;
    }
    polygon.vertices = std::move(kept);
    return polygon.vertices.size() >= 3;
  }

  [[nodiscard]] bool met_surface() const { return surface_count_ > 0; }
  [[nodiscard]] Vector3 surface_mean() const { return surface_sum_ / surface_count_; }

 private:
  /// Crossing of the edge a b with phi = 0 by the Illinois form of false position: the value at an end that stays for a
  /// second time is halved.
  Vector3 root(Vector3 a, double phi_a, Vector3 b, double phi_b) const {
    Vector3 x = a;
    int stayed = 0; // +1: b stayed last time, -1: a did
    for (int iteration = 0; iteration < 12; ++iteration) {
      x = a + phi_a / (phi_a - phi_b) * (b - a);
      const double value = phi(x);
      if (std::abs(value) < 1e-10 || (b - a).squaredNorm() < 1e-20)
        break;
      if ((value < 0) == (phi_a < 0)) {
        a = x;
        phi_a = value;
        if (stayed > 0)
          phi_b *= 0.5;
        stayed = 1;
      } else {
        b = x;
        phi_b = value;
        if (stayed < 0)
          phi_a *= 0.5;
        stayed = -1;
      }
    }
    return x;
  }

  /// The surface bends between two crossings: one vertex on the arc, in the polygon's plane, makes the cut second
  /// order.
  void add_arc(const Vector3& from, const Vector3& to, const Vector3& normal, std::vector<Vector3>& kept) const {
    const Vector3 chord = to - from;
    if (chord.squaredNorm() < 1e-12)
      return;
    const Vector3 outward = chord.cross(normal).normalized();
    const Vector3 middle = 0.5 * (from + to);
    Vector3 x = middle;
    for (int iteration = 0; iteration < 4; ++iteration) {
      const double value = phi(x);
      const double slope = domain_.curved_gradient(node_ + spacing_ * x).dot(outward);
      if (std::abs(slope) < 0.2)
        return;
      x -= value / slope * outward;
      if (std::abs(value) < 1e-8)
        break;
    }
    if ((x - middle).norm() < 0.5 * chord.norm())
      kept.push_back(x);
  }

  const Domain& domain_;
  Vector3 node_;
  double spacing_;
  Vector3 surface_sum_ = Vector3::Zero();
  int surface_count_ = 0;
};

/// One cell under construction.
struct CellBuilder {
  const std::vector<Vector3>& nodes;
  const std::vector<double>& spacings;
  const Domain& domain;
  const PointTree& tree;
  const Incision* incision;
  const std::vector<Vector3>& lookouts; // of the nodes, when there is an incision
  bool curved;
  std::vector<PointTree::Found> near;
  std::vector<double> vertices;
  std::vector<int> face_vertices, neighbours;
  std::vector<double> vertex_phi;

  void build(int i, CellComplex& cells, std::vector<Vector3>& closure);

 private:
  /// A face between nodes that do not see each other, a polygon relative to node i in units of its spacing: what lies
  /// ahead of the front is an ordinary face.
  void add_lip(int i, int j, const std::vector<Vector3>& polygon, const Vector3& outward, CellComplex& cells,
               std::vector<Vector3>& closure) const;
  bool cut(int i, voro::voronoicell_neighbor& cell);
  [[nodiscard]] bool hidden(int i, int j) const {
    if (incision == nullptr)
      return false;
    const Vector3 &a = lookouts[i], &b = lookouts[j];
    return incision->near(0.5 * (a + b), 0.5001 * (b - a).norm()) && incision->blocks(a, b);
  }
};

bool CellBuilder::cut(int i, voro::voronoicell_neighbor& cell) {
  const Vector3& x = nodes[i];
  const double h = spacings[i];
  cell.init(-cell_reach, cell_reach, -cell_reach, cell_reach, -cell_reach, cell_reach);
  for (std::size_t p = 0; p < domain.planes().size(); ++p) {
    const Plane& plane = domain.planes()[p];
    const double distance = -plane.signed_distance(x) / h;
    if (distance < cell_reach * 1.8 && !cell.nplane(plane.normal.x(), plane.normal.y(), plane.normal.z(), 2 * distance,
                                                    first_plane_id - static_cast<int>(p)))
      return false;
  }
  if (curved) {
    const double distance = -domain.curved_distance(x) / h;
    if (distance < 1.5) {
      const Vector3 n = domain.curved_gradient(x);
      cell.nplane(n.x(), n.y(), n.z(), 2 * (distance + cap_height), cap_id);
    }
  }
  double covered = 0, reach = 2.2;
  while (true) {
    near.clear();
    tree.within(x, reach * h, near);
    std::sort(near.begin(), near.end());
    int since_check = 0;
    double needed = 2 * std::sqrt(0.25 * cell.max_radius_squared());
    for (const PointTree::Found& other : near) {
      const double distance = std::sqrt(other.squared_distance) / h;
      if (other.index == i || distance < covered)
        continue;
      if (distance < 1e-7)
        throw InputError(
            fmt::format("nodes {} and {} coincide at ({:.6g}, {:.6g}, {:.6g}) m", i, other.index, x.x(), x.y(), x.z()));
      if (distance > needed)
        return true;
      const Vector3 d = (nodes[other.index] - x) / h;
      if (!cell.nplane(d.x(), d.y(), d.z(), distance * distance, other.index))
        return false;
      if (++since_check == 4) {
        since_check = 0;
        needed = 2 * std::sqrt(0.25 * cell.max_radius_squared());
      }
    }
    needed = 2 * std::sqrt(0.25 * cell.max_radius_squared());
    if (needed <= reach || near.size() == nodes.size())
      return true;
    covered = reach;
    reach = std::min(needed * 1.01, reach * 1.6);
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
    Measure face = part.size() < 3 ? Measure{} : measure(part);
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
    const Measure face = measured(ahead);
    if (face.area.norm() < smallest)
      continue;
    const Vector3 centroid = x + h * face.centroid;
    if (incision->blocks(x, centroid) || incision->blocks(nodes[j], centroid))
      continue;
    const bool all = measured(rest).area.norm() < smallest;
    const Measure& joined = all ? measured(behind) : face;
    cells.faces.push_back({i, j, joined.area * h * h, x + h * joined.centroid});
    append_corners(all ? behind : ahead, x, h, cells.face_corners, cells.face_start);
    closure[i] += joined.area * h * h;
    closure[j] -= joined.area * h * h;
    if (all)
      return;
    behind = std::move(rest);
  }
  const Measure lip = measured(behind);
  const Vector3 area = lip.area * h * h, centroid = x + h * lip.centroid;
  cells.lips.push_back({i, j, area, centroid});
  cells.lips.push_back({j, i, -area, centroid});
  append_corners(behind, x, h, cells.lip_corners, cells.lip_start);
  closure[i] += area;
  closure[j] -= area;
}

void CellBuilder::build(int i, CellComplex& cells, std::vector<Vector3>& closure) {
  voro::voronoicell_neighbor cell;
  if (!cut(i, cell))
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
  if (curved) {
    // phi is 1-Lipschitz: a cell whose radius is less than its depth below the surface cannot meet it.
    const double depth = -domain.curved_distance(x) / h;
    near_surface = depth < std::sqrt(0.25 * cell.max_radius_squared()) * 1.0001;
    if (near_surface)
      for (int v = 0; v < vertex_count; ++v)
        vertex_phi[v] = clipper.phi(vertex(v));
  }

  std::size_t position = 0;
  Polygon polygon;
  for (const int neighbour : neighbours) {
    const int size = face_vertices[position++];
    polygon.vertices.clear();
    polygon.phi.clear();
    Vector3 middle = Vector3::Zero();
    for (int k = 0; k < size; ++k) {
      const int v = face_vertices[position++];
      polygon.vertices.push_back(vertex(v));
      polygon.phi.push_back(vertex_phi[v]);
      middle += polygon.vertices.back() / size;
    }
    const bool planar_boundary = neighbour <= first_plane_id;
    if (neighbour < 0 && !planar_boundary) {
      if (neighbour > cap_id && (!near_surface || CurvedClipper(domain, x, h).clip(polygon)))
        throw InputError(fmt::format("the cell of node {} at ({:.6g}, {:.6g}, {:.6g}) m reaches farther than {} times "
                                     "its spacing {:.3g} m inside the body: the nodes leave a hole there",
                                     i, x.x(), x.y(), x.z(), cell_reach, h));
      continue; // the cap or the box: outside the body
    }
    if (near_surface && !clipper.clip(polygon))
      continue;
    Measure face = measure(polygon.vertices);
    const double face_area = face.area.norm();
    if (face_area < 1e-12)
      continue;
    // Outward from the node. A plane through the node itself is a part of the boundary: its own normal tells.
    const Vector3 outward =
        planar_boundary ? domain.planes()[first_plane_id - neighbour].normal : Vector3(nodes[neighbour] - x);
    if (face.area.dot(outward) < 0)
      face.area = -face.area;
    const Vector3 area = face.area * h * h, centroid = x + h * face.centroid;
    if (planar_boundary) {
      cells.boundary.push_back({i, first_plane_id - neighbour, area, centroid});
      append_corners(polygon.vertices, x, h, cells.boundary_corners, cells.boundary_start);
      closure[i] += area;
    } else if (neighbour > i && hidden(i, neighbour)) {
      add_lip(i, neighbour, polygon.vertices, outward, cells, closure);
    } else if (neighbour > i) {
      cells.faces.push_back({i, neighbour, area, centroid});
      append_corners(polygon.vertices, x, h, cells.face_corners, cells.face_start);
      closure[i] += area;
      closure[neighbour] -= area;
    }
  }
  if (clipper.met_surface()) {
    // Area follows from closure, once every face is known; the place is the mean crossing projected on the surface.
    Vector3 point = x + h * clipper.surface_mean();
    for (int iteration = 0; iteration < 2; ++iteration)
      point -= domain.curved_distance(point) * domain.curved_gradient(point);
    cells.boundary.push_back({i, -1, Vector3::Zero(), point});
    cells.boundary_start.push_back(static_cast<int>(cells.boundary_corners.size()));
  }
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
      if (sheet) {
        const double height = 0.5 * (nodes[i] - nodes[j]).dot(sheet->normal);
        sites[i] = sheet->point + height * sheet->normal;
        sites[j] = sheet->point - height * sheet->normal;
      }
      break;
    }
  }
  return sites;
}

} // namespace

CellComplex voronoi_cells(const std::vector<Vector3>& places, const std::vector<double>& spacings, const Domain& domain,
                          const Incision* incision) {
  const std::vector<Vector3> nodes = incision == nullptr ? places : mirrored_lips(places, spacings, *incision);
  std::vector<Vector3> lookouts;
  for (std::size_t i = 0; incision != nullptr && i < places.size(); ++i)
    lookouts.push_back(lift_off(*incision, places[i], lip_reach * spacings[i], lip_lift * spacings[i]));
  const int count = static_cast<int>(nodes.size());
  CellComplex cells;
  cells.faces.reserve(8 * nodes.size());
  const PointTree tree(nodes);
  std::vector<Vector3> closure(nodes.size(), Vector3::Zero());
  const bool curved = count > 0 && std::isfinite(domain.curved_distance(nodes.front()));
  CellBuilder builder{nodes, spacings, domain, tree, incision, lookouts, curved, {}, {}, {}, {}, {}};
  for (int i = 0; i < count; ++i)
    builder.build(i, cells, closure);
  std::vector<char> on_curve(nodes.size(), 0);
  for (BoundaryFace& face : cells.boundary)
    if (face.plane < 0) {
      face.area = -closure[face.node];
      on_curve[face.node] = 1;
    }
  // The surface can leave a cell exactly through its edges, without a crossing: closure still tells.
  for (int i = 0; curved && i < count; ++i)
    if (!on_curve[i] && closure[i].norm() > 1e-9 * spacings[i] * spacings[i]) {
      cells.boundary.push_back({i, -1, -closure[i], domain.closest_surface_point(nodes[i])});
      cells.boundary_start.push_back(static_cast<int>(cells.boundary_corners.size()));
    }

  // Volume and centroid by cones from the node over the faces.
  cells.volumes.assign(nodes.size(), 0.0);
  cells.centroids.assign(nodes.size(), Vector3::Zero());
  const auto add_cone = [&](int i, const Vector3& area, const Vector3& centroid) {
    const Vector3 arm = centroid - nodes[i];
    const double cone = arm.dot(area) / 3;
    cells.volumes[i] += cone;
    cells.centroids[i] += cone * 0.75 * arm;
  };
  for (const CellFace& face : cells.faces) {
    add_cone(face.first, face.area, face.centroid);
    add_cone(face.second, -face.area, face.centroid);
  }
  for (const LipFace& face : cells.lips)
    add_cone(face.node, face.area, face.centroid);
  for (const BoundaryFace& face : cells.boundary)
    add_cone(face.node, face.area, face.centroid);
  for (int i = 0; i < count; ++i) {
    if (cells.volumes[i] > 0) {
      cells.centroids[i] = nodes[i] + cells.centroids[i] / cells.volumes[i];
    } else {
      cells.centroids[i] = nodes[i];
      ++cells.empty_cells;
    }
  }
  return cells;
}

} // namespace spherecut::topology
