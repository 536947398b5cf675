// The filling of a body with nodes, step by step. Used by sprinkle, resprinkle and extend_sprinkling.
#pragma once

#include "solvers/nodes/cut.hpp"
#include "solvers/nodes/samples.hpp"

#include <random>
#include <span>

namespace spherecut::solvers {

// Distances in units of the mean spacing of two nodes; see node_filler.cpp for what was measured.
constexpr double kept_crowding = 0.7;     // between corners and edge nodes, and between previous nodes
constexpr double sweep_crowding = 0.88;   // above: a place that the front has missed
constexpr double gap_end_clearance = 0.4; // of nodes from the end of a narrow gap, in h
constexpr double sweep_fraction = 0.5;    // size of the samples that find such places, in units of h

/// Throws InputError naming the option that is out of range.
void check_options(const SprinkleOptions& options);

/// Lip nodes of options.incision in pairs, beside the lip nodes of `previous` (may be null), in a region (null:
/// everywhere). They keep clear of one another alone.
NodeCloud lip_places(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud* previous,
                     const BoundingBox* region);

class Filler {
 public:
  /// With a region (m) only places inside it get new nodes; options and domain must outlive the filler.
  Filler(const topology::Domain& domain, const SprinkleOptions& options, const BoundingBox* region = nullptr);

  // In this order; keep() and, without an incision, place_cut() may be left out.
  void place_seeds();
  void keep(const NodeCloud& previous);
  /// In place of the two above, for a region: of the nodes around it those that are `fixed` stay in any case.
  void keep_around(const NodeCloud& previous, const std::vector<bool>& fixed);
  void place_cut();
  void place_edges();
  /// Fronts start from all nodes present, after keep() from those alone around which something has changed.
  void fill_surface();
  void fill_interior();
  /// Severed pieces too thin for nodes beside those of their sheets get nodes on their outer surface all the same.
  void thicken_pieces();

  [[nodiscard]] int size() const { return nodes_.size(); }
  /// The nodes, where they were kept from, and the report; throws when they are too few or a zone is under-filled.
  Sprinkling finish();
  [[nodiscard]] const NodeCloud& nodes() const { return nodes_; }
  /// Per node, -1 for a new one; shorter when the last nodes are new.
  [[nodiscard]] const std::vector<int>& kept_from() const { return kept_from_; }
  [[nodiscard]] const std::vector<VolumeSample>& samples() const { return volume_samples_; }

 private:
  void add(const Vector3& x, double h, NodeKind kind, const Vector3& normal);
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  Matrix3 random_rotation();
  /// Whether x keeps `distance` m from every sheet of the incision.
  [[nodiscard]] bool clear_of_sheets(const Vector3& x, double distance) const {
    return !incision_ || !incision_->near(x, distance) || !incision_->closest(x, distance);
  }
  /// Whether a node may be put at x: in the region, and no other nearer than `crowding` of their mean spacing.
  [[nodiscard]] bool has_room(const Vector3& x, double h, double crowding) const {
    return (region_ == nullptr || region_->contains(x)) && !grid_.crowded(x, h, crowding) && !is_at_gap_end(x, h);
  }
  /// The end of a gap is a front: nodes keep as clear of it as of that of a cut. A place in the middle of a gap's end
  /// would see neither side of it.
  [[nodiscard]] bool is_at_gap_end(const Vector3& x, double h) const {
    if (!options_.walls)
      return false;
    return options_.walls->front_frame(x, gap_end_clearance * h).has_value() ||
           (options_.walls->near(x, lip_offset * h) && options_.walls->closest(x, lip_offset * h));
  }
  [[nodiscard]] bool fits_inside(const Vector3& x, double h, double crowding) const {
    return has_room(x, h, crowding) && domain_.signed_distance(x) <= -options_.wall_clearance * h &&
           clear_of_sheets(x, options_.wall_clearance * h);
  }
  /// In a region that was full: whether a node has gone from the surroundings of x.
  [[nodiscard]] bool may_be_empty(const Vector3& x, double h) const {
    return region_ == nullptr || removed_.crowded(x, h, sweep_crowding);
  }
  /// Mean of the normals of the body on both sides of sharp edges at x, with the given mesh triangles.
  [[nodiscard]] Vector3 edge_normal(const Vector3& x, double h, std::span<const int> triangles) const;
  [[nodiscard]] Vector3 normal_of_edge_seed(const Vector3& x, double h) const;
  void place_along(int curve);
  /// All nodes; where some have been kept those near which something has changed, in a region the new ones alone.
  [[nodiscard]] std::vector<int> front_starts() const;
  void surface_front(std::vector<int> front);
  void interior_front(std::vector<int> front);
  void keep_others(const NodeCloud& previous, std::vector<bool> stays);
  /// Lip nodes of `previous` that still lie on a sheet, both of the pair.
  [[nodiscard]] std::vector<int> lips_to_keep(const NodeCloud& previous) const;
  /// Whether previous node j, no lip node, may stay where h is wanted; ratio: its spacing / h.
  [[nodiscard]] bool still_fits(const NodeCloud& previous, int j, double h, double ratio) const;
  void choose_cut(const NodeCloud* previous);

  const topology::Domain& domain_;
  const SprinkleOptions& options_;
  const SpacingField& spacing_;
  const topology::Incision* incision_; // null: uncut
  const BoundingBox* region_;
  topology::SurfaceMesh local_surface_; // triangles in the region
  const topology::SurfaceMesh& surface_;
  NodeGrid grid_, removed_;
  NodeCloud nodes_;
  std::vector<int> kept_from_;
  std::vector<bool> settled_; // kept nodes around which nothing has changed
  std::vector<VolumeSample> volume_samples_;
  std::mt19937_64 random_;
  std::vector<Vector3> directions_;
  SharpFeatures features_;
  SheetLayout layout_;
  std::vector<int> kept_lips_;     // of the previous nodes
  std::vector<CutNode> cut_nodes_; // chosen, not yet placed
};

} // namespace spherecut::solvers
