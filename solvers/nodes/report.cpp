// What a filling is measured by: nearest neighbours and density per zone, and the number of nodes to expect.
#include "solvers/nodes/features.hpp"
#include "solvers/nodes/samples.hpp"
#include "solvers/nodes/search.hpp"
#include "solvers/nodes/sheets.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double report_fraction = 0.5;   // size of the integration cells in units of h
constexpr double band_ratio = 1.6;        // largest h / smallest h in a zone
constexpr double count_fraction = 0.7;    // size of the cells that estimate the count, in units of h
constexpr double volume_density = 1.035;  // measured on fillings of 200 to 6000 nodes
constexpr double surface_density = 1.033; // the same
constexpr double smallest_expected = 30;  // zones that ask for fewer nodes are joined with a neighbour

/// Share of a small ball about a node of an edge or a lip that lies in the body and, by a lip node's normal, on its
/// side of the sheet.
double inside_share(const topology::Domain& domain, const Vector3& x, double h, const Vector3* lip_normal = nullptr) {
  constexpr int directions = 48;
  int inside = 0;
  for (int k = 0; k < directions; ++k) {
    const double z = 1 - (2 * k + 1.0) / directions, angle = k * std::numbers::pi * (3 - std::sqrt(5.0));
    const double rho = std::sqrt(1 - z * z);
    const Vector3 direction(rho * std::cos(angle), rho * std::sin(angle), z);
    if (lip_normal == nullptr || direction.dot(*lip_normal) < 0)
      inside += domain.signed_distance(x + 0.25 * h * direction) < 0;
  }
  return static_cast<double>(inside) / directions;
}

} // namespace

double node_share(const topology::Domain& domain, const Vector3& x, double h, NodeKind kind, const Vector3& normal) {
  switch (kind) {
  case NodeKind::interior:
    return 1;
  case NodeKind::surface:
    return 0.5;
  case NodeKind::edge:
    return inside_share(domain, x, h);
  case NodeKind::lip:
    return domain.signed_distance(x) < -0.25 * h ? 0.5 : inside_share(domain, x, h, &normal);
  }
  return 1;
}

namespace {

/// Limits of the bands of h, ascending, one more than there are bands.
std::vector<double> band_limits(const std::vector<VolumeSample>& samples) {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const VolumeSample& sample : samples) {
    low = std::min(low, sample.spacing);
    high = std::max(high, sample.spacing);
  }
  const int bands = std::max(1, static_cast<int>(std::ceil(std::log(high / low) / std::log(band_ratio) - 1e-9)));
  std::vector<double> expected(bands, 0);
  std::vector<double> limits;
  for (int k = 0; k <= bands; ++k)
    limits.push_back(low * std::pow(high / low, static_cast<double>(k) / bands));
  for (const VolumeSample& sample : samples) {
    const auto above = std::upper_bound(limits.begin() + 1, limits.end() - 1, sample.spacing);
    expected[above - limits.begin() - 1] += sample.expected;
  }
  for (std::size_t k = 0; expected.size() > 1 && k < expected.size();) {
    if (expected[k] >= smallest_expected) {
      ++k;
      continue;
    }
    const std::size_t join = k + 1 < expected.size() ? k : k - 1; // with the coarser one, the coarsest with the finer
    expected[join] += expected[join + 1];
    expected.erase(expected.begin() + static_cast<std::ptrdiff_t>(join) + 1);
    limits.erase(limits.begin() + static_cast<std::ptrdiff_t>(join) + 1);
    k = join;
  }
  return limits;
}

double count(const topology::Domain& domain, const SharpFeatures& features, const SpacingField& spacing,
             const topology::Incision* incision) {
  constexpr int limit = 20'000'000;
  double volume = 0, area = 0, edges = 0; // in units of h^3, h^2, h
  if (incision != nullptr)                // both faces of the sheets
    for (const SheetSample& sample : lay_out_sheets(domain, features, spacing, *incision, domain.surface()).samples)
      area += 2 * sample.expected;
  for (const VolumeSample& sample : sample_volume(domain, spacing, count_fraction, limit))
    volume += sample.expected;
  for (const SurfaceSample& sample : sample_surface(domain.surface(), spacing, count_fraction, limit))
    area += sample.expected;
  const topology::SurfaceMesh& mesh = domain.surface();
  for (const SharpCurve& curve : features.curves) {
    for (int s = 0; s + 1 < std::ssize(curve.vertices); ++s) {
      const Vector3 &a = mesh.vertices[curve.vertices[s]], &b = mesh.vertices[curve.vertices[s + 1]];
      edges += (b - a).norm() / spacing(0.5 * (a + b));
    }
    edges -= curve.closed ? 0 : 1;
  }
  // A node on a face, an edge, a corner fills 1/2, 1/4, 1/8 of a cell. With every face and edge filled to its own
  // density that leaves half a node per h^2 of surface, a quarter per h of edge, half per corner beyond the volume
  // (exact for a cubic lattice).
  return volume_density * volume + 0.5 * surface_density * area + 0.25 * std::max(edges, 0.0) +
         0.5 * static_cast<double>(features.corners.size());
}

} // namespace

SprinkleReport inspect_filling(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& nodes) {
  return inspect_filling(domain, options, nodes,
                         sample_volume(domain, options.spacing, report_fraction, options.maximum_nodes));
}

SprinkleReport inspect_filling(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& nodes,
                               const std::vector<VolumeSample>& samples) {
  const SpacingField& spacing = options.spacing;
  if (samples.empty())
    throw InputError("sprinkle: the body has no volume");
  const std::vector<double> limits = band_limits(samples);
  const auto zone_of = [&](double h) {
    return std::upper_bound(limits.begin() + 1, limits.end() - 1, h) - limits.begin() - 1;
  };
  SprinkleReport report;
  report.zones.resize(limits.size() - 1);
  for (std::size_t z = 0; z + 1 < limits.size(); ++z) {
    report.zones[z].spacing_from = limits[z];
    report.zones[z].spacing_to = limits[z + 1];
  }
  for (const VolumeSample& sample : samples)
    report.zones[zone_of(sample.spacing)].expected += sample.expected;

  double smallest = limits.front();
  for (const Vector3& x : nodes.positions)
    smallest = std::min(smallest, spacing(x));
  NodeGrid grid(smallest, spacing.slope);
  for (const Vector3& x : nodes.positions)
    grid.add(x, spacing(x));
  std::vector<std::vector<double>> nearest(report.zones.size());
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3& x = nodes.positions[i];
    const double h = spacing(x);
    SprinkleZone& zone = report.zones[zone_of(h)];
    ++zone.nodes;
    if (i >= std::ssize(options.seeds))
      // A partner across the sheet does not count.
      nearest[zone_of(h)].push_back(
          grid.nearest_in_spacings(x, h, i, nodes.kinds[i] == NodeKind::lip ? 20 * lip_offset * h : -1));
    switch (nodes.kinds[i]) {
    case NodeKind::interior:
      ++report.interior_nodes;
      break;
    case NodeKind::surface:
      ++report.surface_nodes;
      break;
    case NodeKind::edge:
      ++report.edge_nodes;
      break;
    case NodeKind::lip:
      ++report.lip_nodes;
      break;
    }
    zone.density += node_share(domain, x, h, nodes.kinds[i], nodes.normals[i]) / zone.expected;
  }
  for (std::size_t z = 0; z < report.zones.size(); ++z) {
    if (nearest[z].empty())
      continue;
    const auto middle = nearest[z].begin() + static_cast<std::ptrdiff_t>(nearest[z].size() / 2);
    std::nth_element(nearest[z].begin(), middle, nearest[z].end());
    report.zones[z].nearest_median = *middle;
    report.zones[z].nearest_min = *std::min_element(nearest[z].begin(), nearest[z].end());
  }
  return report;
}

void require_filled(const SprinkleReport& report, double minimum_density) {
  for (const SprinkleZone& zone : report.zones) {
    const double limit = minimum_density - 0.3 / std::sqrt(zone.expected);
    if (!(zone.density >= limit))
      throw NumericalError(
          fmt::format("sprinkle: the zone with spacings of {:.4g} to {:.4g} m is under-filled: {} nodes, "
                      "density {:.3f} where at least {:.3f} is needed",
                      zone.spacing_from, zone.spacing_to, zone.nodes, zone.density, limit));
  }
}

double expected_count(const topology::Domain& domain, const SpacingField& spacing, double sharp_edge_degrees,
                      const topology::Incision* incision) {
  return count(domain, find_sharp_features(domain.surface(), sharp_edge_degrees), spacing, incision);
}

SpacingField spacing_for_count(const topology::Domain& domain, const SpacingField& shape, int target,
                               const SprinkleOptions& options) {
  const double volume = topology::volume(domain.surface());
  if (target < 4 || target > options.maximum_nodes)
    throw InputError(fmt::format("spacing_for_count: {} nodes are asked for; allowed are 4 to maximum_nodes = {}",
                                 target, options.maximum_nodes));
  if (!(shape.fine > 0) || !(shape.coarse >= shape.fine) || !(volume > 0))
    throw InputError(fmt::format("spacing_for_count: fine {} m, coarse {} m, volume {} m3; they must be positive and "
                                 "fine <= coarse",
                                 shape.fine, shape.coarse, volume));
  SpacingField scaled = shape;
  const SharpFeatures features = find_sharp_features(domain.surface(), options.sharp_edge_degrees);
  // Lip nodes that stand apart are not counted: they have no unknowns.
  const topology::Incision* const counted = options.lips_apart ? nullptr : options.incision.get();
  const auto count_at = [&](double log_scale) {
    scaled.fine = std::exp(log_scale) * shape.fine;
    scaled.coarse = std::exp(log_scale) * shape.coarse;
    return count(domain, features, scaled, counted) + static_cast<double>(options.seeds.size());
  };
  // Newton's method in logarithms with the secant slope; the count falls no faster than scale^-3, so that starting from
  // too few nodes never overshoots by much.
  const auto solve = [&](double log_scale, double wanted, double tolerance) {
    double reached = count_at(log_scale), slope = -3;
    for (int step = 0; step < 30 && std::abs(reached / wanted - 1) > tolerance; ++step) {
      const double change = std::clamp(std::log(wanted / reached) / slope, -0.7, 0.7);
      const double next = count_at(log_scale + change);
      if (std::abs(change) > 1e-9)
        slope = std::clamp(std::log(next / reached) / change, -3.0, -0.3);
      log_scale += change;
      reached = next;
    }
    if (!(std::abs(reached / wanted - 1) < 0.05))
      throw InputError(
          fmt::format("spacing_for_count: no spacing gives {} nodes; the nearest count is {:.0f}", target, reached));
    return log_scale;
  };
  // Trial fillings show by how much the estimate is off for this body; the best is taken.
  SprinkleOptions trial = options;
  trial.minimum_density = 0;
  if (options.lips_apart)
    trial.incision = nullptr;
  SpacingField best = shape;
  double smallest_miss = std::numeric_limits<double>::infinity(), wanted = target;
  double log_scale = std::log(std::cbrt(volume / target) / shape.fine);
  for (int attempt = 0; attempt < 3 && smallest_miss > 0.01 * target; ++attempt) {
    log_scale = solve(log_scale, wanted, 0.003);
    trial.spacing = scaled;
    const double made = sprinkle(domain, trial).nodes.size();
    if (std::abs(made - target) < smallest_miss) {
      smallest_miss = std::abs(made - target);
      best = scaled;
    }
    wanted *= target / made;
  }
  return best;
}

} // namespace spherecut::solvers
