// Filling a body with nodes by an advancing front.
// Notation: h(x) wanted spacing at x; a node "crowds" x when |x - x_j| < f (h(x) + h_j) / 2.
#include "solvers/nodes/filler.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <utility>

namespace spherecut::solvers {

namespace {

// Distances in units of the mean spacing of the two nodes. A front that steps by h and refuses below 0.93 h fills to a
// density of 0.85 h^-3; these steps, 7 % shorter, fill to 1.03. Relaxing the nodes by repulsion afterwards was measured
// and left out: it raised the mean nearest distance by 2 % and widened its spread.
constexpr double front_step = 0.93;
constexpr double front_crowding = 0.87; // below: a candidate is refused
constexpr int surface_candidates = 14;
constexpr int interior_candidates = 20;
constexpr double rim_clearance = 0.45, edge_clearance = 0.4; // of surface and edge nodes from the sheets, in h

/// Directions spread evenly over the sphere (golden-angle spiral).
std::vector<Vector3> spiral_directions(int count) {
  std::vector<Vector3> directions;
  for (int k = 0; k < count; ++k) {
    const double z = 1 - (2 * k + 1.0) / count, angle = k * std::numbers::pi * (3 - std::sqrt(5.0));
    const double rho = std::sqrt(1 - z * z);
    directions.emplace_back(rho * std::cos(angle), rho * std::sin(angle), z);
  }
  return directions;
}

/// Triangles of a surface that meet the box.
topology::SurfaceMesh part_of(const topology::SurfaceMesh& surface, const BoundingBox& box) {
  topology::SurfaceMesh part;
  std::vector<int> index(surface.vertices.size(), -1);
  for (const Triangle& t : surface.triangles) {
    const Vector3 &a = surface.vertices[t[0]], &b = surface.vertices[t[1]], &c = surface.vertices[t[2]];
    if ((a.cwiseMin(b).cwiseMin(c).array() > box.upper.array()).any() ||
        (a.cwiseMax(b).cwiseMax(c).array() < box.lower.array()).any())
      continue;
    Triangle& corners = part.triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      if (index[t[k]] < 0) {
        index[t[k]] = static_cast<int>(part.vertices.size());
        part.vertices.push_back(surface.vertices[t[k]]);
      }
      corners[k] = index[t[k]];
    }
  }
  return part;
}

} // namespace

void check_options(const SprinkleOptions& options) {
  const SpacingField& s = options.spacing;
  const auto refuse = [](const char* name, double value, const char* limit) {
    throw InputError(fmt::format("sprinkle: {} is {}; it must be {}", name, value, limit));
  };
  if (!(s.fine > 0) || !std::isfinite(s.fine))
    refuse("spacing.fine", s.fine, "positive, in metres");
  if (!(s.coarse >= s.fine) || !std::isfinite(s.coarse))
    refuse("spacing.coarse", s.coarse, "at least spacing.fine, in metres");
  if (!(s.slope >= 0 && s.slope <= 1))
    refuse("spacing.slope", s.slope, "between 0 and 1");
  if (!(s.radius >= 0) || !std::isfinite(s.radius))
    refuse("spacing.radius", s.radius, "at least 0 m");
  if (!(s.plateau >= 0) || !std::isfinite(s.plateau))
    refuse("spacing.plateau", s.plateau, "at least 0");
  if (!(options.sharp_edge_degrees > 0 && options.sharp_edge_degrees <= 180))
    refuse("sharp_edge_degrees", options.sharp_edge_degrees, "in (0, 180]");
  if (!(options.wall_clearance >= 0 && options.wall_clearance <= 0.9))
    refuse("wall_clearance", options.wall_clearance, "between 0 and 0.9 h");
  if (options.maximum_nodes < 4)
    refuse("maximum_nodes", options.maximum_nodes, "at least 4");
}

NodeCloud lip_places(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud* previous,
                     const BoundingBox* region) {
  const SpacingField& spacing = options.spacing;
  const topology::SurfaceMesh local = region == nullptr ? topology::SurfaceMesh{} : part_of(domain.surface(), *region);
  const topology::SurfaceMesh& surface = region == nullptr ? domain.surface() : local;
  const SharpFeatures features = find_sharp_features(surface, options.sharp_edge_degrees);
  const SheetLayout layout = lay_out_sheets(domain, features, spacing, *options.incision, surface, region);
  NodeCloud known;
  Surroundings there;
  if (previous != nullptr)
    for (int j = 0; j < previous->size(); ++j)
      if (previous->kinds[j] == NodeKind::lip)
        there.lips.push_back(known.add(*previous, j));
  const NodeGrid nothing(spacing.finest(), spacing.slope);
  there.taken = &nothing;
  there.previous = previous != nullptr ? &known : nullptr;
  there.region = region;
  SprinkleOptions pairs = options;
  pairs.ring_ahead = false;
  NodeCloud places;
  for (const CutNode& node : choose_cut_nodes(domain, pairs, features, surface, layout, there))
    places.add(node.position, node.spacing, node.kind, node.normal);
  return places;
}

Filler::Filler(const topology::Domain& domain, const SprinkleOptions& options, const BoundingBox* region)
    : domain_(domain), options_(options), spacing_(options.spacing), incision_(options.incision.get()), region_(region),
      local_surface_(region == nullptr ? topology::SurfaceMesh{} : part_of(domain.surface(), *region)),
      surface_(region == nullptr ? domain.surface() : local_surface_), grid_(spacing_.finest(), spacing_.slope),
      removed_(spacing_.finest(), spacing_.slope),
      volume_samples_(sample_volume(domain, spacing_, sweep_fraction, options.maximum_nodes, region)),
      random_(options.random_seed), directions_(spiral_directions(interior_candidates)),
      features_(find_sharp_features(surface_, options.sharp_edge_degrees)) {
  grid_.set_walls(options.walls.get());
  removed_.set_walls(options.walls.get());
  if (incision_ != nullptr)
    layout_ = lay_out_sheets(domain, features_, spacing_, *incision_, surface_, region);
}

void Filler::add(const Vector3& x, double h, NodeKind kind, const Vector3& normal) {
  if (size() >= options_.maximum_nodes)
    throw InputError(fmt::format("sprinkle: more than maximum_nodes = {} nodes are needed at spacings of {} to {} m",
                                 options_.maximum_nodes, spacing_.fine, spacing_.coarse));
  nodes_.add(x, h, kind, normal);
  grid_.add(x, h);
}

Matrix3 Filler::random_rotation() {
  // Uniform on the rotations [Shoemake 1992].
  const double u = uniform(), v = 2 * std::numbers::pi * uniform(), w = 2 * std::numbers::pi * uniform();
  const double a = std::sqrt(1 - u), b = std::sqrt(u);
  return Eigen::Quaterniond(a * std::sin(v), a * std::cos(v), b * std::sin(w), b * std::cos(w)).toRotationMatrix();
}

// ---- seeds and sharp edges

Vector3 Filler::edge_normal(const Vector3& x, double h, std::span<const int> triangles) const {
  const topology::SurfaceMesh& mesh = surface_;
  Vector3 sum = Vector3::Zero();
  for (int t : triangles) {
    const Triangle& v = mesh.triangles[t];
    const Vector3 into_face = (mesh.vertices[v[0]] + mesh.vertices[v[1]] + mesh.vertices[v[2]]) / 3 - x;
    const double length = into_face.norm();
    const Vector3 beside = x + std::min(1e-3 * h / length, 0.5) * into_face;
    sum += domain_.normal(domain_.closest_surface_point(beside));
  }
  return sum.norm() > 1e-6 ? Vector3(sum.normalized()) : domain_.normal(x);
}

Vector3 Filler::normal_of_edge_seed(const Vector3& x, double h) const {
  const topology::SurfaceMesh& mesh = surface_;
  for (int k = 0; k < std::ssize(features_.corners); ++k)
    if ((mesh.vertices[features_.corners[k]] - x).norm() < 1e-6 * h)
      return edge_normal(x, h, features_.corner_triangles[k]);
  double best = std::numeric_limits<double>::infinity();
  const std::array<int, 2>* faces = nullptr;
  for (const SharpCurve& curve : features_.curves)
    for (int s = 0; s + 1 < std::ssize(curve.vertices); ++s) {
      const Vector3& a = mesh.vertices[curve.vertices[s]];
      const Vector3 ab = mesh.vertices[curve.vertices[s + 1]] - a;
      const double distance = (a + std::clamp(ab.dot(x - a) / ab.squaredNorm(), 0.0, 1.0) * ab - x).norm();
      if (distance < best) {
        best = distance;
        faces = &curve.faces[s];
      }
    }
  return faces != nullptr && best < h ? edge_normal(x, h, *faces) : domain_.normal(x);
}

void Filler::place_seeds() {
  const double tolerance = 1e-6 * domain_.bounds().extent().norm();
  for (int k = 0; k < std::ssize(options_.seeds); ++k) {
    const Vector3& x = options_.seeds[k].position;
    const NodeKind kind = options_.seeds[k].kind;
    const double outside = domain_.signed_distance(x), h = spacing_(x);
    const auto place = [&] { return fmt::format("seed {} at ({}, {}, {}) m", k, x.x(), x.y(), x.z()); };
    if (!x.allFinite() || !(outside <= tolerance))
      throw InputError(
          fmt::format("sprinkle: {} lies {} m outside the body; the limit is {} m", place(), outside, tolerance));
    if ((kind == NodeKind::surface || kind == NodeKind::edge) && outside < -0.1 * h)
      throw InputError(
          fmt::format("sprinkle: {} is a surface seed but lies {} m inside the body; the limit is 0.1 h, {} "
                      "m",
                      place(), -outside, 0.1 * h));
    if (const double nearest = grid_.nearest_distance(x, h); nearest < 1e-3 * h)
      throw InputError(fmt::format("sprinkle: {} lies {} m from another seed; the limit is 0.001 h, {} m", place(),
                                   nearest, 1e-3 * h));
    const auto sheet = incision_ != nullptr ? incision_->closest(x, h) : std::nullopt;
    if (sheet && sheet->distance < 0.5 * lip_offset * h)
      throw InputError(
          fmt::format("sprinkle: {} lies {} m from a sheet of the incision: on which side is not told; the "
                      "limit is {} of h, {} m",
                      place(), sheet->distance, 0.5 * lip_offset, 0.5 * lip_offset * h));
    if (kind == NodeKind::lip && !sheet)
      throw InputError(fmt::format("sprinkle: {} is a lip node, but no sheet comes within h = {} m of it", place(), h));
    Vector3 normal = Vector3::Zero();
    if (kind == NodeKind::edge)
      normal = normal_of_edge_seed(x, h);
    else if (kind == NodeKind::surface)
      normal = domain_.normal(x);
    else if (kind == NodeKind::lip)
      normal = (x - sheet->point).dot(sheet->normal) > 0 ? Vector3(-sheet->normal) : sheet->normal;
    add(x, h, kind, normal);
  }
}

std::vector<int> Filler::front_starts() const {
  std::vector<int> starts;
  for (int i = 0; i < size(); ++i)
    if (i >= std::ssize(settled_) || (!settled_[i] && region_ == nullptr))
      starts.push_back(i);
  return starts;
}

// ---- sharp edges

void Filler::place_along(int index) {
  const SharpCurve& curve = features_.curves[index];
  // Length in units of h along the polyline: samples (segment, parameter, measure so far).
  const topology::SurfaceMesh& mesh = surface_;
  struct Station {
    int segment;
    double parameter, measure;
  };
  std::vector<Station> stations{{0, 0, 0}};
  const auto point = [&](int segment, double t) -> Vector3 {
    return (1 - t) * mesh.vertices[curve.vertices[segment]] + t * mesh.vertices[curve.vertices[segment + 1]];
  };
  double measure = 0;
  for (int s = 0; s < std::ssize(curve.faces); ++s) {
    const double length = (point(s, 1) - point(s, 0)).norm();
    for (double t = 0; t < 1;) {
      const double step = std::min(1 - t, 0.1 * spacing_(point(s, t)) / length);
      measure += step * length / spacing_(point(s, t + 0.5 * step));
      t = t + step > 1 - 1e-9 ? 1 : t + step;
      stations.push_back({s, t, measure});
    }
  }
  // The sheets of an incision cut the curve into parts; the pairs there are already placed.
  std::vector<double> ends{0, measure};
  for (const SharpCrossing& crossing : layout_.edges)
    if (crossing.curve == index) {
      const auto after = std::find_if(stations.begin() + 1, stations.end() - 1, [&](const Station& station) {
        return std::pair(station.segment, station.parameter) >= std::pair(crossing.segment, crossing.t);
      });
      ends.push_back(after->measure);
    }
  std::sort(ends.begin(), ends.end());
  for (std::size_t part = 0; part + 1 < ends.size(); ++part) {
    const double from = ends[part], to = ends[part + 1];
    const int intervals = std::max(curve.closed && ends.size() == 2 ? 3 : 1, static_cast<int>(std::lround(to - from)));
    for (int k = curve.closed && part == 0 ? 0 : 1; k < intervals; ++k) {
      const double wanted = from + (to - from) * k / intervals;
      const auto above = std::upper_bound(stations.begin() + 1, stations.end() - 1, wanted,
                                          [](double m, const Station& station) { return m < station.measure; });
      const auto& below = *(above - 1);
      const double start = below.segment == above->segment ? below.parameter : 0;
      const double t = start + (above->parameter - start) * (wanted - below.measure) / (above->measure - below.measure);
      const bool at_vertex = k == 0;
      const Vector3 x =
          at_vertex ? point(0, 0) : onto_sharp_edge(domain_, mesh, curve, above->segment, point(above->segment, t));
      const double h = spacing_(x);
      if (has_room(x, h, kept_crowding) && clear_of_sheets(x, edge_clearance * h))
        add(x, h, NodeKind::edge, edge_normal(x, h, curve.faces[above->segment]));
    }
  }
}

void Filler::place_edges() {
  const topology::SurfaceMesh& mesh = surface_;
  // Creases shorter than two spacings in all are below the resolution: the smooth front covers them.
  std::vector<double> length(features_.components, 0); // in units of h
  for (const SharpCurve& curve : features_.curves)
    for (int s = 0; s + 1 < std::ssize(curve.vertices); ++s) {
      const Vector3 &a = mesh.vertices[curve.vertices[s]], &b = mesh.vertices[curve.vertices[s + 1]];
      length[curve.component] += (b - a).norm() / spacing_(0.5 * (a + b));
    }
  for (int k = 0; k < std::ssize(features_.corners); ++k) {
    const Vector3& x = mesh.vertices[features_.corners[k]];
    const double h = spacing_(x);
    if (length[features_.corner_component[k]] >= 2 && has_room(x, h, kept_crowding) &&
        clear_of_sheets(x, edge_clearance * h))
      add(x, h, NodeKind::edge, edge_normal(x, h, features_.corner_triangles[k]));
  }
  for (int c = 0; c < std::ssize(features_.curves); ++c)
    if (length[features_.curves[c].component] >= 2)
      place_along(c);
}

// ---- fronts

void Filler::surface_front(std::vector<int> front) {
  for (std::size_t next = 0; next < front.size(); ++next) {
    interruption_point();
    const int i = front[next];
    const Vector3 centre = nodes_.positions[i];
    const bool lip = nodes_.kinds[i] == NodeKind::lip; // on the rim: its own normal is that of the sheet
    if (nodes_.kinds[i] == NodeKind::interior ||
        (lip && domain_.signed_distance(centre) < -0.5 * lip_offset * nodes_.spacings[i]))
      continue;
    const Vector3 n = lip ? domain_.normal(centre) : nodes_.normals[i];
    const Vector3 u = n.unitOrthogonal(), v = n.cross(u);
    const double turn = uniform();
    for (int k = 0; k < surface_candidates; ++k) {
      const double angle = 2 * std::numbers::pi * (k + turn) / surface_candidates;
      const Vector3 direction = std::cos(angle) * u + std::sin(angle) * v;
      double step = front_step * nodes_.spacings[i];
      Vector3 x = centre + step * direction;
      if (grid_.crowded(x, spacing_(x), 0.6)) // no projection can free it
        continue;
      // The distance wanted is the mean spacing of both ends; it is approached by scaling the step.
      for (int attempt = 0; attempt < 4; ++attempt) {
        x = domain_.closest_surface_point(centre + step * direction);
        const double distance = (x - centre).norm(), wanted = 0.5 * front_step * (nodes_.spacings[i] + spacing_(x));
        if (std::abs(distance - wanted) <= 0.02 * wanted || distance < 0.2 * wanted)
          break;
        step *= wanted / distance;
      }
      const double h = spacing_(x), distance = (x - centre).norm();
      if (distance > 1.1 * std::max(h, nodes_.spacings[i]) || !has_room(x, h, front_crowding) ||
          !clear_of_sheets(x, rim_clearance * h))
        continue;
      add(x, h, NodeKind::surface, domain_.normal(x));
      front.push_back(size() - 1);
    }
  }
}

void Filler::fill_surface() {
  surface_front(front_starts());
  for (const SurfaceSample& sample : sample_surface(surface_, spacing_, sweep_fraction, options_.maximum_nodes)) {
    if (!may_be_empty(sample.point, sample.spacing) || grid_.crowded(sample.point, sample.spacing, sweep_crowding))
      continue;
    const Vector3 x = domain_.closest_surface_point(sample.point);
    const double h = spacing_(x);
    if (!has_room(x, h, sweep_crowding) || !clear_of_sheets(x, rim_clearance * h))
      continue;
    add(x, h, NodeKind::surface, domain_.normal(x));
    surface_front({size() - 1});
  }
}

void Filler::interior_front(std::vector<int> front) {
  for (std::size_t next = 0; next < front.size(); ++next) {
    interruption_point();
    const int i = front[next];
    const Vector3 centre = nodes_.positions[i], n = nodes_.normals[i];
    const Matrix3 rotation = random_rotation();
    for (const Vector3& fixed : directions_) {
      const Vector3 direction = rotation * fixed;
      if (direction.dot(n) > 0) // out of the body, or along its surface
        continue;
      double step = front_step * nodes_.spacings[i], h = step;
      Vector3 x;
      for (int attempt = 0; attempt < 4; ++attempt) {
        x = centre + step * direction;
        h = spacing_(x);
        const double wanted = 0.5 * front_step * (nodes_.spacings[i] + h);
        if (std::abs(wanted - step) <= 0.02 * step)
          break;
        step = wanted;
      }
      if (!fits_inside(x, h, front_crowding))
        continue;
      add(x, h, NodeKind::interior, Vector3::Zero());
      front.push_back(size() - 1);
    }
  }
}

void Filler::fill_interior() {
  interior_front(front_starts());
  for (const auto& [x, h, expected] : volume_samples_) {
    if (!may_be_empty(x, h) || !fits_inside(x, h, sweep_crowding))
      continue;
    add(x, h, NodeKind::interior, Vector3::Zero());
    interior_front({size() - 1});
  }
}

Sprinkling Filler::finish() {
  if (size() < 4)
    throw InputError(
        fmt::format("sprinkle: of at least 4 nodes only {} would fit into the body at spacings of {} to {} m", size(),
                    spacing_.fine, spacing_.coarse));
  for (int i = 0; i < size(); ++i)
    nodes_.reaches[i] = spacing_.reach(nodes_.positions[i], nodes_.spacings[i]);
  Sprinkling result;
  result.report = inspect_filling(domain_, options_, nodes_, volume_samples_);
  require_filled(result.report, options_.minimum_density);
  if (incision_ != nullptr)
    result.report.pieces = inspect_pieces(nodes_, *incision_);
  if (!kept_from_.empty())
    kept_from_.resize(nodes_.size(), -1);
  result.nodes = std::move(nodes_);
  result.walls = options_.walls;
  result.kept_from = std::move(kept_from_);
  return result;
}

} // namespace spherecut::solvers
