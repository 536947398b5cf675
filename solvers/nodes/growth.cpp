// Nodes for one increment of a cut, found in the neighbourhood of what is new of its sheets.
#include "solvers/nodes/filler.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace spherecut::solvers {

namespace {

constexpr double touched_reach = 2;   // of the region around new triangles, in units of h
constexpr double context_reach = 1.5; // nodes this far around the region are taken into account, in units of h

using Corners = std::array<Vector3, 3>;

Corners corners_of(const topology::SurfaceMesh& sheet, int t) {
  const Triangle& v = sheet.triangles[t];
  return {sheet.vertices[v[0]], sheet.vertices[v[1]], sheet.vertices[v[2]]};
}

std::array<double, 9> key_of(const Corners& corners) {
  std::array<double, 9> key{};
  for (int k = 0; k < 9; ++k)
    key[k] = corners[k / 3][k % 3];
  return key;
}

/// Calls visit(corners) for the triangles of `one` that are not in `other`, to the bit and from the same corner.
template <class Visitor>
void for_each_missing(const topology::Incision& one, const topology::Incision* other, Visitor&& visit) {
  std::set<std::array<double, 9>> keys; // of `other`, when a triangle is not at the same place in its list
  const auto known = [&](int s, int t, const Corners& corners) {
    if (other == nullptr)
      return false;
    const auto& sheets = other->sheets();
    if (s < std::ssize(sheets) && t < std::ssize(sheets[s].triangles) && corners_of(sheets[s], t) == corners)
      return true;
    if (keys.empty())
      for (const topology::SurfaceMesh& sheet : sheets)
        for (int k = 0; k < std::ssize(sheet.triangles); ++k)
          keys.insert(key_of(corners_of(sheet, k)));
    return keys.contains(key_of(corners));
  };
  for (int s = 0; s < std::ssize(one.sheets()); ++s)
    for (int t = 0; t < std::ssize(one.sheets()[s].triangles); ++t)
      if (const Corners corners = corners_of(one.sheets()[s], t); !known(s, t, corners))
        visit(corners);
}

/// Box around what changed between the two incisions and its surroundings; empty (lower above upper) when nothing did.
BoundingBox changed_region(const topology::Incision* before, const topology::Incision& after,
                           const topology::Domain& domain, const SpacingField& spacing) {
  BoundingBox region{Vector3::Constant(std::numeric_limits<double>::infinity()),
                     Vector3::Constant(-std::numeric_limits<double>::infinity())};
  const auto include = [&](const Corners& corners) {
    for (const Vector3& x : corners) {
      const Vector3 margin = Vector3::Constant(touched_reach * spacing(x));
      region.lower = region.lower.cwiseMin(x - margin);
      region.upper = region.upper.cwiseMax(x + margin);
    }
  };
  for_each_missing(after, before, include);
  if (before != nullptr)
    for_each_missing(*before, &after, include);
  const BoundingBox body = domain.bounds();
  return {region.lower.cwiseMax(body.lower - 0.01 * body.extent()),
          region.upper.cwiseMin(body.upper + 0.01 * body.extent())};
}

double coarsest_in(const BoundingBox& box, const SpacingField& spacing) {
  double h = spacing(box.centre());
  for (int corner = 0; corner < 8; ++corner)
    h = std::max(h, spacing({(corner & 1) != 0 ? box.lower.x() : box.upper.x(),
                             (corner & 2) != 0 ? box.lower.y() : box.upper.y(),
                             (corner & 4) != 0 ? box.lower.z() : box.upper.z()}));
  return h;
}

/// The field with those segments and centres alone that can matter in the box.
SpacingField local_field(const SpacingField& spacing, const BoundingBox& box) {
  const double reach = spacing.slope > 0 ? (spacing.coarse - spacing.fine) / spacing.slope : 0;
  const double margin = reach + spacing.plateau * spacing.fine + spacing.radius;
  const Vector3 lower = box.lower.array() - margin, upper = box.upper.array() + margin;
  SpacingField local = spacing;
  if (spacing.slope == 0 || (spacing.centres.empty() && spacing.segments.empty()))
    return local;
  std::erase_if(local.centres, [&](const Vector3& c) {
    return (c.array() < lower.array()).any() || (c.array() > upper.array()).any();
  });
  std::erase_if(local.segments, [&](const std::array<Vector3, 2>& ends) {
    return (ends[0].cwiseMax(ends[1]).array() < lower.array()).any() ||
           (ends[0].cwiseMin(ends[1]).array() > upper.array()).any();
  });
  if (local.centres.empty() && local.segments.empty())
    local.fine = local.coarse;
  return local;
}

} // namespace

SprinkleIncrement extend_sprinkling(const topology::Domain& domain, const SprinkleOptions& options,
                                    const NodeCloud& previous, const topology::Incision* before) {
  check_options(options);
  if (!options.incision)
    throw InputError("extend_sprinkling: options.incision is null; it must be the cut as it is now");
  SprinkleIncrement increment;
  const BoundingBox region = changed_region(before, *options.incision, domain, options.spacing);
  if ((region.lower.array() > region.upper.array()).any())
    return increment;
  if (options.lips_apart) {
    increment.added = lip_places(domain, options, &previous, &region);
    return increment;
  }
  const double margin = context_reach * coarsest_in(region, options.spacing);
  const BoundingBox context{region.lower.array() - margin, region.upper.array() + margin};
  SprinkleOptions local = options;
  local.spacing = local_field(options.spacing, context);

  NodeCloud around;
  std::vector<int> ids;
  std::vector<bool> fixed;
  for (int j = 0; j < previous.size(); ++j)
    if (const Vector3& x = previous.positions[j]; context.contains(x)) {
      around.add(previous, j);
      ids.push_back(j);
      // Lips outside the region too: their pairs are not chosen anew, and the search for pairs has to know them.
      const bool is_seed = std::any_of(options.seeds.begin(), options.seeds.end(),
                                       [&](const SeedNode& seed) { return seed.position == x; });
      fixed.push_back(previous.kinds[j] != NodeKind::lip && (is_seed || !region.contains(x)));
    }
  Filler filler(domain, local, &region);
  filler.keep_around(around, fixed);
  filler.place_cut();
  filler.place_edges();
  filler.fill_surface();
  filler.fill_interior();

  const NodeCloud& nodes = filler.nodes();
  std::vector<bool> kept(ids.size(), false);
  for (int i = 0; i < nodes.size(); ++i)
    if (i < std::ssize(filler.kept_from()) && filler.kept_from()[i] >= 0)
      kept[filler.kept_from()[i]] = true;
    else
      increment.added.reaches[increment.added.add(nodes, i)] =
          options.spacing.reach(nodes.positions[i], nodes.spacings[i]);
  for (std::size_t k = 0; k < ids.size(); ++k)
    if (!kept[k] && region.contains(around.positions[k]))
      increment.removed.push_back(ids[k]);

  SprinkleZone& zone = increment.touched;
  zone.spacing_from = std::numeric_limits<double>::infinity();
  for (const VolumeSample& sample : filler.samples())
    if (region.contains(sample.point)) {
      zone.expected += sample.expected;
      zone.spacing_from = std::min(zone.spacing_from, sample.spacing);
      zone.spacing_to = std::max(zone.spacing_to, sample.spacing);
    }
  double shares = 0;
  for (int i = 0; i < nodes.size(); ++i)
    if (region.contains(nodes.positions[i])) {
      ++zone.nodes;
      shares += node_share(domain, nodes.positions[i], nodes.spacings[i], nodes.kinds[i], nodes.normals[i]);
    }
  if (zone.expected > 0) {
    zone.density = shares / zone.expected;
    SprinkleReport report;
    report.zones = {zone};
    require_filled(report, options.minimum_density);
  }
  return increment;
}

} // namespace spherecut::solvers
