// Nodes of the method of finite spheres and their sprinkling.
#pragma once

#include "topology/incision/incision.hpp"

#include <cstdint>
#include <string>

namespace spherecut::solvers {

enum class NodeKind : std::uint8_t {
  interior,
  surface, // on a smooth part of the surface
  edge,    // on a sharp edge or corner of the surface
  lip,     // on a face of an incision, see lip_offset
};

/// A lip node sits this far from the sheet, in units of its spacing, on the side of the material it belongs to; its
/// partner sits as far on the other side. Far below any length of the mechanics and far above rounding, so that sight
/// lines, nearest nodes and Voronoi cells tell the two faces apart without being told a side.
constexpr double lip_offset = 1e-4;

/// Structure of arrays; all vectors have the same length N.
struct NodeCloud {
  std::vector<Vector3> positions; // m, rest frame
  std::vector<double> spacings;   // local node spacing h, m
  std::vector<double> reaches;    // m, at most h; support radius = rho * reach where the method says so, else rho * h
  std::vector<NodeKind> kinds;
  std::vector<Vector3> normals; // unit outward normal of surface and edge nodes and, out of its face, of a lip node
  [[nodiscard]] int size() const { return static_cast<int>(positions.size()); }
  /// Adds a node whose reach is its spacing.
  int add(const Vector3& position, double spacing, NodeKind kind, const Vector3& normal = Vector3::Zero());
  /// Adds node `i` of another cloud as it is there.
  int add(const NodeCloud& other, int i);
};

/// Index of each lip node's partner across the sheet, -1 where there is none and for nodes of other kinds.
std::vector<int> lip_partners(const NodeCloud& nodes);

/// Spacing that grows linearly with the distance from a fine zone, h(x) = clamp(fine + slope (distance - plateau)).
/// The distance is to the nearest of `centres` less `radius`, or to the nearest of `segments`: whichever is smaller.
struct SpacingField {
  double fine = 0.01;             // m
  double coarse = 0.01;           // m
  double slope = 0.3;             // m per m
  double radius = 0;              // m, radius of the fine zone about each centre
  double plateau = 1.5;           // in units of fine: extra width of constant spacing around the zone
  std::vector<Vector3> centres{}; // of balls, a tool's contact; with no segments either: `coarse` everywhere
  std::vector<std::array<Vector3, 2>> segments{}; // m, ends of straight pieces: the front of a cut, the way ahead of it
  [[nodiscard]] double operator()(const Vector3& x) const;
  /// m: radius, over rho, of the sphere of a node placed at x with spacing h. It is h where the spacing is constant. A
  /// sphere of two spacings reaches far into a zone that is finer, where it meets many times the nodes that it would
  /// meet otherwise, and couples them all: it is shrunk until the field asks for no more nodes in it than a constant
  /// spacing would.
  [[nodiscard]] double reach(const Vector3& x, double h) const;
  /// m, nothing asks for less
  [[nodiscard]] double finest() const { return centres.empty() && segments.empty() ? coarse : fine; }
};

/// The front of an incision as segments of a SpacingField: runs that turn by little are joined to pieces of at most
/// `length` m, straight ones whatever their length, so that the field stays cheap.
std::vector<std::array<Vector3, 2>> front_segments(const topology::Incision& incision, double length);

/// A node that must be where it is put (tool tip, contact rings, lips), with its kind and normal.
struct SeedNode {
  Vector3 position;
  NodeKind kind = NodeKind::surface;
};

struct SprinkleOptions {
  SpacingField spacing;
  std::vector<SeedNode> seeds;    // placed first, in this order, never moved
  std::uint64_t random_seed = 1;  // same seed, same bits
  double sharp_edge_degrees = 40; // angle between the normals across a mesh edge above which it carries edge nodes
  double wall_clearance = 0.45;   // in units of h: interior nodes stay this far from the surface
  int maximum_nodes = 200000;     // refused above, InputError
  double minimum_density = 0.8;   // a zone below is under-filled, NumericalError
  /// The cut of the body: lip nodes in pairs on both faces, a ring of pairs behind the front. Null: uncut.
  std::shared_ptr<const topology::Incision> incision;
  /// Walls of narrow gaps of the body's own surface (gap_walls.hpp): nodes on both sides of one do not crowd each
  /// other.
  std::shared_ptr<const topology::Incision> walls;
  /// A ring of single nodes ahead of the front, too, where a method wants it (wants_ring_ahead). It moves with the
  /// front: an increment exchanges ten nodes where it exchanges one or two without.
  bool ring_ahead = false;
  /// Lip nodes are places on the faces of the cut and nothing else: the body is filled as if it were uncut, and they
  /// come after all other nodes. An increment of the cut then adds some and removes none.
  bool lips_apart = false;
};

/// What was checked about a sprinkled cloud, per zone of distance from the fine zone. Every node counts with the share
/// of its surroundings that lies in the body: 1 inside, 1/2 on a smooth surface, about 1/4 on a square edge and 1/8 in
/// its corner, so that a cubic lattice has density 1 whatever its size.
struct SprinkleZone {
  double spacing_from = 0, spacing_to = 0; // m, the band of h that this zone covers
  int nodes = 0;
  // Distance of a node (seeds left out) to its nearest neighbour, in units of the mean spacing of the two.
  double nearest_min = 0, nearest_median = 0;
  double expected = 0; // integral over the zone of dV / h^3
  double density = 0;  // sum of the nodes' shares / expected (about 1 to 1.2 when full)
};
/// Nodes of a cut body that are connected by sight.
struct SprinklePiece {
  int nodes = 0;
  Vector3 centroid = Vector3::Zero(); // m, of its nodes
  bool flat = false; // fewer than 4 nodes, or within 0.05 h (root mean square) of a plane: no linear field fits
};
struct SprinkleReport {
  std::vector<SprinkleZone> zones;
  int surface_nodes = 0, edge_nodes = 0, interior_nodes = 0, lip_nodes = 0;
  std::vector<SprinklePiece> pieces; // largest first; empty without an incision
};

struct Sprinkling {
  NodeCloud nodes;
  SprinkleReport report;
  std::vector<int> kept_from; // resprinkle alone: index of each node in the previous cloud, -1 for a new one
  std::shared_ptr<const topology::Incision> walls; // SprinkleOptions::walls that they were made with
};

/// Fills the domain: seeds, then sharp edges, surface, interior, by an advancing front with candidates at distance 0.93
/// h [Slak and Kosec 2019]; then every sample point (half a spacing apart) that is left farther than 0.88 h from all
/// nodes gets one. Reports nearest-neighbour distance and density per zone and throws NumericalError when a zone is
/// under-filled; InputError on spacings or slopes out of range, seeds outside the body or on one another, fewer than 4
/// nodes, or more than maximum_nodes.
Sprinkling sprinkle(const topology::Domain& domain, const SprinkleOptions& options);

/// The same after the fine zone has moved (the tool slides): the new seeds first, then every node of `previous` that
/// still fits, in its order and with identical position, then new nodes in the gaps. A node fits when the spacing it
/// was placed with is at most 25 % below and 10 % above the one wanted now (coarser is the tighter limit because
/// spacing too coarse by 10 % already costs a quarter of the density), when no node kept before it is nearer than 0.7
/// of their mean spacing, 0.8 where the spacing has grown, and when it still keeps clear of the wall. A seed that
/// coincides with a previous node counts as kept. Lip pairs stay while their sheet is there; other nodes go when a
/// sheet comes within 0.3 h of them or a new lip pair or ring node needs their place. With unchanged options the result
/// is the previous cloud, bit for bit (nodes of severed pieces thinner than 0.45 h excepted). Throws as sprinkle does.
Sprinkling resprinkle(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& previous);

/// What one increment of a cut changes in a cloud.
struct SprinkleIncrement {
  std::vector<int> removed; // nodes of the previous cloud that have to go, ascending
  NodeCloud added;          // to be appended; lip nodes in pairs, the node on the + side of the sheet first
  SprinkleZone touched;     // expected number and density of the region that was looked at
};

/// The fast variant of resprinkle for a cut that has grown: looks at what lies within two spacings of the sheets' new
/// triangles alone. Nodes there that the new sheet crowds go, those farther away are left as they are; lip pairs stay
/// where they are when the front moves on, a ring ahead moves with it, new pairs and nodes fill what has become
/// empty. options.incision is the cut as it is now, `before` as it was (null: uncut); options.spacing must be the field
/// that `previous` was placed with, fine where the cut goes. Throws as sprinkle does, of the density in the
/// region alone.
SprinkleIncrement extend_sprinkling(const topology::Domain& domain, const SprinkleOptions& options,
                                    const NodeCloud& previous, const topology::Incision* before);

/// Piece of each node: nodes closer than twice the mean of their spacings that see each other belong together. Pieces
/// are numbered by falling number of nodes, then by their first node.
std::vector<int> node_pieces(const NodeCloud& nodes, const topology::Incision& incision);

/// Nearest-neighbour distance and density of a cloud per zone of h; options.seeds are its first nodes.
SprinkleReport inspect_filling(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& nodes);

/// Throws NumericalError naming the zone when a density is below minimum_density - 0.3 / sqrt(expected): the fewer
/// nodes a zone asks for, the more its density scatters. The lowest of 2880 fillings (48 bodies and spacings, 60 random
/// seeds) was 0.805, where 8 nodes are expected.
void require_filled(const SprinkleReport& report, double minimum_density);

/// Number of nodes to expect of sprinkle: integrals of dV/h^3, dA/2h^2 (over both faces of sheets too) and, along sharp
/// edges, ds/4h, scaled to what the filling was measured to give. Within about 10 % above 100 nodes.
double expected_count(const topology::Domain& domain, const SpacingField& spacing, double sharp_edge_degrees = 40,
                      const topology::Incision* incision = nullptr);

/// `shape` with fine and coarse scaled by one factor such that a sprinkling has about `target` nodes (options.spacing
/// is not used, the seeds are). Throws InputError when target is below 4 or no factor gives it.
SpacingField spacing_for_count(const topology::Domain& domain, const SpacingField& shape, int target,
                               const SprinkleOptions& options = {});

} // namespace spherecut::solvers
