// Nodes of the method of finite spheres and their sprinkling.
#pragma once

#include "topology/domain.hpp"

#include <cstdint>
#include <string>

namespace spherecut::solvers {

enum class NodeKind : std::uint8_t {
  interior,
  surface, // on a smooth part of the surface
  edge,    // on a sharp edge or corner of the surface
};

/// Structure of arrays; all vectors have the same length N.
struct NodeCloud {
  std::vector<Vector3> positions; // m, rest frame
  std::vector<double> spacings;   // local node spacing h, m; support radius = rho * h
  std::vector<NodeKind> kinds;
  std::vector<Vector3> normals; // unit outward normal of surface and edge nodes, zero inside
  [[nodiscard]] int size() const { return static_cast<int>(positions.size()); }
  int add(const Vector3& position, double spacing, NodeKind kind, const Vector3& normal = Vector3::Zero());
};

/// Spacing that grows linearly with the distance from a fine zone, h(x) = clamp(fine + slope (distance - plateau)).
/// The distance is to the nearest of `centres` less `radius`.
struct SpacingField {
  double fine = 0.01;           // m
  double coarse = 0.01;         // m
  double slope = 0.3;           // m per m
  double radius = 0;            // m, radius of the fine zone about each centre
  double plateau = 1.5;         // in units of fine: extra width of constant spacing around the zone
  std::vector<Vector3> centres; // empty: `coarse` everywhere
  [[nodiscard]] double operator()(const Vector3& x) const;
};

/// A node that must be where it is put (tool tip, contact rings, lips), with its kind and normal.
struct SeedNode {
  Vector3 position;
  NodeKind kind = NodeKind::surface;
};

struct SprinkleOptions {
  SpacingField spacing;
  std::vector<SeedNode> seeds;    // placed first, in this order, never moved
  std::uint64_t random_seed = 1;  // same seed, same bits
  double sharp_edge_degrees = 40; // dihedral angle above which a mesh edge carries edge nodes
  double wall_clearance = 0.45;   // in units of h: interior nodes stay this far from the surface
  int maximum_nodes = 200000;     // refused above, InputError
};

/// What was checked about a sprinkled cloud, per zone of distance from the fine zone.
struct SprinkleZone {
  double spacing_from = 0, spacing_to = 0; // m, the band of h that this zone covers
  int nodes = 0;
  double nearest_min = 0, nearest_median = 0; // nearest-neighbour distance / h
  double density = 0;                         // nodes / integral over the zone of dV / h^3 (about 1 to 1.2 when full)
};
struct SprinkleReport {
  std::vector<SprinkleZone> zones;
  int surface_nodes = 0, edge_nodes = 0, interior_nodes = 0;
};

struct Sprinkling {
  NodeCloud nodes;
  SprinkleReport report;
};

/// Fills the domain: seeds, then sharp edges, surface, interior, by an advancing front with candidates at distance h(x)
/// [Slak and Kosec 2019]. Checks nearest-neighbour distance and density per zone and throws NumericalError when a zone
/// is under-filled; InputError on non-positive spacings, fewer than 4 nodes, or more than maximum_nodes.
Sprinkling sprinkle(const topology::Domain& domain, const SprinkleOptions& options);

} // namespace spherecut::solvers
