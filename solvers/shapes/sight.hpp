// How spheres of influence reach around a cut and across faces between materials.
#pragma once

#include "solvers/elasticity/regions.hpp"
#include "solvers/shapes/tuning.hpp"
#include "topology/incision/incision.hpp"

#include <memory>
#include <string_view>

namespace spherecut::solvers {

enum class SightRule {
  visibility,  // a sphere ends where the incision hides its node
  diffraction, // it bends around the front: the distance is that of the shortest way around
  enriched,    // diffraction, and the basis gains sqrt(r) {cos t/2, sin t/2, sin t/2 sin t, cos t/2 sin t} at the front
  appended,    // spheres stay what they are, and the cut appends functions (solvers/appended; galerkin alone)
};
std::string_view to_string(SightRule rule);
/// Throws InputError naming the value and the allowed names.
SightRule sight_rule_from_string(std::string_view name);

/// The cut that the spheres of a node cloud must not see through.
struct Sight {
  std::shared_ptr<const topology::Incision> incision; // null: uncut
  SightRule rule = SightRule::enriched;
  double reach = Tuning{}.front_reach; // enrichment ends this far from the front, in units of h as the spheres take it
  double blend =
      Tuning{}.front_blend; // and fades from this part of the reach on, so that the shape functions stay continuous
  /// So often all spheres about a node may grow where it sees too few others for the enriched basis; then the linear
  /// one does for it, and points beside it look farther for themselves.
  int enriched_growth = 0;
  /// Spheres of nodes within `reach` of the front are larger by this; an enriched basis may want it.
  double radius_factor = 1;
  /// Parts of the body with a material of their own: the basis has ramps beside their faces (interface_ramps.hpp).
  /// Null: none. Not together with an incision.
  std::shared_ptr<const MaterialRegions> regions{};
};

} // namespace spherecut::solvers
