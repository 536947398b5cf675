// Where a scenario wants fine nodes: at the tool's contact, at the cuts, and along the way of the blade.
#pragma once

#include "src/model/organ.hpp"
#include "topology/incision/incision.hpp"
#include "topology/tool/contact.hpp"

namespace spherecut::app {

/// The fine zone, with every length derived that the scenario leaves out.
struct FineZone {
  solvers::SpacingField spacing;
  double candidate_radius = 0; // m
};

/// Nodes that the derived spacing at the fronts of precuts may ask for.
inline constexpr int front_budget = 8000;

/// Spacings of a scenario, still without the places where they are fine. Throws InputError when they contradict each
/// other.
FineZone fine_zone(const Scenario& scenario, const topology::Domain& domain);

/// What the spacing at the front of a precut costs, where it is above a fifth of how deep the precut reaches behind its
/// front; nothing where all fronts are finer.
std::optional<std::string> coarse_front(const Scenario& scenario, const topology::Domain& domain, const FineZone& zone);

/// What it costs where two precuts that do not meet are nearer to each other than two node distances there, one entry a
/// pair; `incision`: theirs, in their order. Of cuts whose spheres bend around fronts (cut.sight = "enriched").
std::vector<std::string> close_precuts(const Scenario& scenario, const topology::Incision& incision,
                                       const FineZone& zone);

/// Edge of the triangles of built-in sheets and of the blade's sweep, m.
double sheet_edge(const FineZone& zone);

/// Nodes that must stand at the contact: one there; about a flat punch on a flat surface also rings on both sides of
/// its edge, where the pressure peaks, and about a grasper, whose patch would else be as large as the nodes happen to
/// lie.
std::vector<solvers::SeedNode> contact_seeds(const Scenario& scenario, const topology::Domain& domain,
                                             const topology::SurfaceContact& contact, double spacing);

} // namespace spherecut::app
