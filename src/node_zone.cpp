#include "src/node_zone.hpp"

#include "solvers/contact_rings.hpp"
#include "src/precut_sheets.hpp"
#include "src/schedule.hpp"
#include "topology/errors.hpp"
#include "topology/sheet_front.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double sheet_edges = 0.5;   // edges of a sheet's triangles, of the fine spacing
constexpr double across_precut = 6;   // derived spacings across a precut
constexpr double across_blade = 12;   // and along the edge of a blade
constexpr double across_organ = 10;   // and, at the coarsest, across the organ
constexpr double whole_across = 0.05; // edges of the sheet by which the area inside is told, of the organ's extent
// Of a disc's radius. Opening volume under pressure, `galerkin`, against Sneddon's: 5.9 % too small at 0.3 radii, 3.8 %
// at 0.22, 2.6 % at 0.18, 1.5 % at 0.15.
constexpr double of_disc = 0.15;

// Root of the area, m.
double size_of(const PrecutSettings& precut, double extent) {
  if (const auto* disc = std::get_if<DiscSheet>(&precut.shape))
    return across_precut * of_disc * disc->radius;
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
  const double extent = domain.bounds().extent().maxCoeff(), whole = size_of(precut, extent);
  if (std::holds_alternative<SheetFile>(precut.shape))
    return whole;
  try {
    const topology::SurfaceMesh sheet = precut_sheet(precut, domain, whole_across * extent);
    const double inside = topology::area_inside(sheet, domain);
    return inside > 0 && inside < (1 - 1e-9) * topology::area(sheet) ? std::sqrt(inside) : whole;
  } catch (const InputError&) { // told where the sheets are made, with the line
    return whole;
  }
}

// m; infinite without cuts.
double derived_front_spacing(const Scenario& scenario, const topology::Domain& domain) {
  const double extent = domain.bounds().extent().maxCoeff();
  double spacing = std::numeric_limits<double>::infinity();
  for (const PrecutSettings& precut : scenario.precuts)
    spacing = std::min(spacing, std::min(size_inside(precut, domain), extent) / across_precut);
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
    zone.spacing.fine = cuts ? derived_front_spacing(scenario, domain) : extent / across_organ;
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
  zone.spacing.slope = nodes.slope;
  if (scenario.tool)
    zone.spacing.radius = nodes.fine_radius > 0 ? nodes.fine_radius : 1.5 * topology::tip_radius(scenario.tool->shape);
  zone.candidate_radius = scenario.contact.candidate_radius > 0 ? scenario.contact.candidate_radius
                                                                : zone.spacing.radius + 2 * zone.spacing.fine;
  return zone;
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
