#include "src/model/node_zone.hpp"

#include "solvers/body/contact_rings.hpp"
#include "src/model/body_model.hpp"
#include "src/model/precut_sheets.hpp"
#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/sheet_front.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::app {
namespace {

constexpr double sheet_edges = 0.5;   // edges of a sheet's triangles, of the fine spacing
constexpr double across_precut = 6;   // derived spacings across a precut
constexpr double across_blade = 12;   // and along the edge of a blade
constexpr double across_organ = 10;   // and, at the coarsest, across the organ
constexpr double whole_across = 0.05; // edges of the sheet by which the area inside is told, of the organ's extent
constexpr double of_size = 1.0 / 24;  // edges of the sheet by which its depth is told, of the root of that area
constexpr double of_depth = 0.15;     // derived spacing, of the depth of a precut behind its front
constexpr double told_from = 0.2;     // spacing, of that depth, from which on its error is told
constexpr double whole = 0.99;        // of a disc's radius, from which on that is its depth
constexpr int budget_steps = 8;
// Spacings between two precuts. Discs of 16 and 20 mm, one under pressure, on nodes 2 mm apart against 1 mm: by
// `enriched` the opening is 51, 42, 24 and 9 % too small where they are 2, 3, 4 and 6 mm apart, by `appended` 37, 23, 5
// and 5 %.
constexpr double apart_for_openings = 2, wanted_between = 3;

// Root of the area, m.
double size_of(const PrecutSettings& precut, double extent) {
  if (const auto* disc = std::get_if<DiscSheet>(&precut.shape))
    return std::sqrt(std::numbers::pi) * disc->radius;
  if (const auto* rectangle = std::get_if<RectangleSheet>(&precut.shape))
    return std::sqrt(rectangle->width * rectangle->height);
  if (const auto* polygon = std::get_if<PolygonSheet>(&precut.shape)) {
    Vector3 area = Vector3::Zero();
    for (std::size_t i = 2; i < polygon->points.size(); ++i)
      area += 0.5 * (polygon->points[i - 1] - polygon->points[0]).cross(polygon->points[i] - polygon->points[0]);
    return std::sqrt(area.norm());
  }
  return extent / 2; // a file: a sheet about as large as the organ
}

// Root of the area of a precut that lies in the body, m; of a file's its size is a guess.
double size_inside(const PrecutSettings& precut, const topology::Domain& domain) {
  const double extent = domain.bounds().extent().maxCoeff(), all = size_of(precut, extent);
  if (std::holds_alternative<SheetFile>(precut.shape))
    return all;
  try {
    const topology::SurfaceMesh sheet = precut_sheet(precut, domain, whole_across * extent);
    const double inside = topology::area_inside(sheet, domain);
    return inside > 0 && inside < (1 - 1e-9) * topology::area(sheet) ? std::sqrt(inside) : all;
  } catch (const InputError&) { // told where the sheets are made, with the line
    return all;
  }
}

using Segment = std::array<Vector3, 2>;

// The border of a sheet inside the body.
std::vector<Segment> front_of(const topology::SurfaceMesh& sheet, const topology::Domain& domain) {
  const auto neighbours = topology::triangle_neighbours(sheet);
  std::vector<Segment> front;
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e) {
      const Segment edge{sheet.vertices[sheet.triangles[t][e]], sheet.vertices[sheet.triangles[t][(e + 1) % 3]]};
      if (neighbours[t][e] < 0 && domain.signed_distance(0.5 * (edge[0] + edge[1])) < 0)
        front.push_back(edge);
    }
  return front;
}

// Its corners there, and where its edges leave the body.
std::vector<Vector3> points_inside(const topology::SurfaceMesh& sheet, const topology::Domain& domain) {
  std::vector<double> distances;
  distances.reserve(sheet.vertices.size());
  std::vector<Vector3> points;
  for (const Vector3& x : sheet.vertices) {
    distances.push_back(domain.signed_distance(x));
    if (distances.back() <= 0)
      points.push_back(x);
  }
  for (const Triangle& triangle : sheet.triangles)
    for (int e = 0; e < 3; ++e) {
      const Vector3 &from = sheet.vertices[triangle[e]], &to = sheet.vertices[triangle[(e + 1) % 3]];
      const double inside = distances[triangle[e]], outside = distances[triangle[(e + 1) % 3]];
      if (inside < 0 && outside > 0)
        points.push_back(from + inside / (inside - outside) * (to - from));
    }
  return points;
}

double distance_to(const Segment& segment, const Vector3& x) {
  const Vector3 along = segment[1] - segment[0];
  const double share = std::clamp((x - segment[0]).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (x - segment[0] - share * along).norm();
}

// What the spacing at the front of a precut is to be held against.
struct PrecutExtent {
  double size = 0;  // m, root of the area inside the body
  double depth = 0; // m, greatest distance of its points in the body from its front: a disc's radius, the depth of a
                    // cut from the surface; 0 where there is no front
  std::vector<Segment> front;
};

PrecutExtent extent_of(const PrecutSettings& precut, const topology::Domain& domain) {
  PrecutExtent extent{size_inside(precut, domain), 0, {}};
  try {
    const topology::SurfaceMesh sheet = precut_sheet(precut, domain, of_size * extent.size);
    extent.front = front_of(sheet, domain);
    for (const Vector3& x : points_inside(sheet, domain)) {
      double nearest = extent.front.empty() ? 0 : std::numeric_limits<double>::infinity();
      for (const Segment& segment : extent.front)
        nearest = std::min(nearest, distance_to(segment, x));
      extent.depth = std::max(extent.depth, nearest);
    }
    if (const auto* disc = std::get_if<DiscSheet>(&precut.shape);
        disc != nullptr && extent.depth > whole * disc->radius)
      extent.depth = disc->radius; // its border is a polygon
  } catch (const InputError&) {    // told where the sheets are made, with the line
  }
  return extent;
}

// m, for the fronts of the precuts alone; infinite without any. The zone's coarse spacing and slope are known.
double precut_spacing(const Scenario& scenario, const topology::Domain& domain, solvers::SpacingField field) {
  const double extent = domain.bounds().extent().maxCoeff();
  double plain = std::numeric_limits<double>::infinity(), wanted = plain;
  for (const PrecutSettings& precut : scenario.precuts) {
    const PrecutExtent of = extent_of(precut, domain);
    plain = std::min(plain, std::min(of.size, extent) / across_precut);
    if (of.depth > 0)
      wanted = std::min(wanted, of_depth * of.depth);
    field.segments.insert(field.segments.end(), of.front.begin(), of.front.end());
  }
  if (!(wanted < plain))
    return plain;
  const auto count_at = [&](double fine) {
    field.fine = std::min(fine, field.coarse);
    return solvers::expected_count(domain, field);
  };
  if (count_at(wanted) <= front_budget)
    return wanted;
  double lower = wanted, upper = plain;
  for (int step = 0; step < budget_steps && upper > 1.02 * lower; ++step) {
    const double middle = std::sqrt(lower * upper);
    (count_at(middle) > front_budget ? lower : upper) = middle;
  }
  return upper;
}

// m; infinite without cuts.
double derived_front_spacing(const Scenario& scenario, const topology::Domain& domain,
                             const solvers::SpacingField& field) {
  const double extent = domain.bounds().extent().maxCoeff();
  double spacing = precut_spacing(scenario, domain, field);
  if (scenario.blade)
    spacing = std::min(spacing, std::min(edge_length(*scenario.blade), extent) / across_blade);
  return spacing;
}

} // namespace

FineZone fine_zone(const Scenario& scenario, const topology::Domain& domain) {
  const NodeSettings& nodes = scenario.nodes;
  const double extent = domain.bounds().extent().maxCoeff();
  const bool cuts = scenario.blade || !scenario.precuts.empty() || scenario.tearing.enabled;
  bool is_derived = false;
  FineZone zone;
  zone.spacing.slope = nodes.slope;
  zone.spacing.fine = nodes.fine_spacing;
  if (zone.spacing.fine <= 0 && scenario.tool) {
    zone.spacing.fine = topology::tip_radius(scenario.tool->shape) / 3;
    is_derived = true;
  }
  if (const double front = scenario.cut.front_spacing;
      cuts && front > 0 && (zone.spacing.fine <= 0 || front < zone.spacing.fine)) {
    zone.spacing.fine = front;
    is_derived = false;
  }
  if (zone.spacing.fine <= 0) {
    zone.spacing.coarse = nodes.coarse_spacing > 0 ? nodes.coarse_spacing : extent / across_organ;
    zone.spacing.fine = cuts ? derived_front_spacing(scenario, domain, zone.spacing) : extent / across_organ;
    if (!std::isfinite(zone.spacing.fine) || zone.spacing.fine <= 0) // tears start anywhere; a sheet without area
      zone.spacing.fine = extent / across_organ;
    is_derived = true;
  }
  if (is_derived && nodes.coarse_spacing > 0) // what the user says is the coarsest is so for what is derived
    zone.spacing.fine = std::min(zone.spacing.fine, nodes.coarse_spacing);
  zone.spacing.coarse =
      nodes.coarse_spacing > 0 ? nodes.coarse_spacing : std::max(zone.spacing.fine, extent / across_organ);
  if (zone.spacing.coarse < zone.spacing.fine) // nodes.fine_spacing has been held against it where it was read
    throw InputError(fmt::format("nodes.coarse_spacing = {:g} m is below cut.front_spacing = {:g} m; allowed: at least "
                                 "that",
                                 zone.spacing.coarse, zone.spacing.fine));
  if (scenario.tool)
    zone.spacing.radius = nodes.fine_radius > 0 ? nodes.fine_radius : 1.5 * topology::tip_radius(scenario.tool->shape);
  zone.candidate_radius = scenario.contact.candidate_radius > 0 ? scenario.contact.candidate_radius
                                                                : zone.spacing.radius + 2 * zone.spacing.fine;
  return zone;
}

std::optional<std::string> coarse_front(const Scenario& scenario, const topology::Domain& domain,
                                        const FineZone& zone) {
  for (std::size_t p = 0; p < scenario.precuts.size(); ++p) {
    const double depth = extent_of(scenario.precuts[p], domain).depth;
    const double fine = zone.spacing.fine;
    if (!(depth > 0) || fine <= told_from * depth)
      continue;
    return fmt::format("precut[{}]: the nodes at its front are {:.3g} mm apart, {:.2g} of its depth of {:.3g} mm "
                       "behind it, and the intensities there are off by some per cent; cut.front_spacing = {:.2g} m is "
                       "{:g} of that",
                       p + 1, 1e3 * fine, fine / depth, 1e3 * depth, of_depth * depth, of_depth);
  }
  return std::nullopt;
}

namespace {

struct Nearness {
  double distance = std::numeric_limits<double>::infinity(); // m
  double spacing = 0;                                        // m, of the nodes there
  Vector3 place = Vector3::Zero();                           // m
  bool meets = false;                                        // the sheets cross or touch
};

// How near vertices of sheet a inside the body come to sheet b, over the spacing there.
Nearness nearness(const topology::Incision& cut, int a, int b, const solvers::SpacingField& spacing) {
  constexpr double touching = 1e-3; // of the spacing
  const topology::SurfaceMesh& sheet = cut.sheets()[static_cast<std::size_t>(a)];
  std::vector<double> side(sheet.vertices.size(), 0); // m, of b; 0 where b ends or is far
  Nearness nearest;
  for (std::size_t v = 0; v < sheet.vertices.size(); ++v) {
    const Vector3& x = sheet.vertices[v];
    const double reach = apart_for_openings * spacing(x);
    const auto found = cut.closest_of(b, x, reach);
    if (!found || cut.domain()->signed_distance(x) > 0)
      continue;
    if (!found->on_border)
      side[v] = (x - found->point).dot(found->normal);
    nearest.meets = nearest.meets || found->distance < touching * spacing(x);
    if (found->distance * nearest.spacing < nearest.distance * spacing(x) || nearest.spacing == 0)
      nearest = {found->distance, spacing(x), x, nearest.meets};
  }
  for (const Triangle& triangle : sheet.triangles)
    for (int e = 0; e < 3; ++e)
      nearest.meets = nearest.meets || side[triangle[e]] * side[triangle[(e + 1) % 3]] < 0;
  return nearest;
}

} // namespace

std::vector<std::string> close_precuts(const Scenario& scenario, const topology::Incision& incision,
                                       const FineZone& zone) {
  std::vector<std::string> told;
  if (sight_of(scenario) != solvers::SightRule::enriched)
    return told;
  const auto count = static_cast<int>(scenario.precuts.size());
  for (int a = 0; a < count; ++a)
    for (int b = a + 1; b < count; ++b) {
      const Nearness from = nearness(incision, a, b, zone.spacing), to = nearness(incision, b, a, zone.spacing);
      const Nearness& near = from.distance <= to.distance ? from : to;
      if (from.meets || to.meets || !std::isfinite(near.distance))
        continue;
      told.push_back(fmt::format(
          "precut[{}] and precut[{}] are {:.3g} mm apart at [{:.4g}, {:.4g}, {:.4g}] m and the nodes there {:.3g} mm: "
          "nearer than {:g} node distances what lies between is too stiff by cut.sight = \"enriched\", and openings "
          "may be too small by a quarter and more; cut.front_spacing and nodes.coarse_spacing = {:.2g} m put {:g} "
          "between, and cut.sight = \"appended\" is nearer on the same nodes",
          a + 1, b + 1, 1e3 * near.distance, near.place.x(), near.place.y(), near.place.z(), 1e3 * near.spacing,
          apart_for_openings, near.distance / wanted_between, wanted_between));
    }
  return told;
}

double sheet_edge(const FineZone& zone) {
  return sheet_edges * zone.spacing.fine;
}

std::vector<solvers::SeedNode> contact_seeds(const Scenario& scenario, const topology::Domain& domain,
                                             const topology::SurfaceContact& contact, double spacing) {
  std::vector<solvers::SeedNode> tip{{contact.point, solvers::NodeKind::surface}};
  const auto* punch = std::get_if<topology::FlatPunch>(&scenario.tool->shape);
  const bool grasps = scenario.tool->grasp.has_value();
  if (!grasps && (punch == nullptr || punch->radius < 2 * spacing))
    return tip;
  const double radius = topology::tip_radius(scenario.tool->shape);
  const auto flat = [&](const solvers::SeedNode& seed) {
    return domain.normal(seed.position).dot(contact.normal) > 0.95 &&
           std::abs((seed.position - contact.point).dot(contact.normal)) < 0.25 * spacing;
  };
  try {
    std::vector<solvers::SeedNode> rings = solvers::contact_rings(
        domain, contact.point, contact.normal, radius, spacing, solvers::contact_ring_offset(scenario.method.method));
    return std::all_of(rings.begin(), rings.end(), flat) ? rings : tip;
  } catch (const InputError&) { // punch or jaws reach over the edge of the organ
    return tip;
  }
}

} // namespace spherecut::app
