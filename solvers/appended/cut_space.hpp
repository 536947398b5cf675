// The functions that a cut appends to those of the uncut body: twins of spheres that the sheets part, and functions
// gathered along the front. The functions of the uncut body stay what they are.
#pragma once

#include "solvers/appended/cut_boxes.hpp"
#include "solvers/appended/front_functions.hpp"

#include <memory>

namespace spherecut::solvers {

struct CutSpaceOptions {
  FrontOptions front;
  /// Spheres that a curved front ends in have twins too, with a step that closes at the front over `step_reach`
  /// spacings (0: none has). A run of the front is curved where it turns by more than `step_turn` within a sphere over
  /// most of its length; on straight ones, corners included, the front functions do as well with half as many.
  double step_reach = 1;
  double step_turn = 20; // degrees
};

/// A second vector unknown of a sphere: h_J psi. Where the cut parts the sphere, psi is 1 in one component of what is
/// hidden from its node and 0 elsewhere. Where a front ends in it, psi = (step(x) - step(x_J)) / 2,
///
///   step = sign(b) q(t),  t^2 = (r - a) / (2 R),  q = (15 t - 10 t^3 + 3 t^5) / 8, 1 beyond t = 1,
///
/// which opens like sqrt(r) behind the front.
struct Twin {
  int node = -1;
  std::vector<PartId> hidden; // ascending; of a step: all parts in reach of the sphere
  bool is_step = false;
  double step_at_node = 0, step_length = 0; // of a step; m
};

/// One of the appended functions. Each has three unknowns: the components of a twin, the modes of a front group.
struct CutFunction {
  int id = -1; // stays with the function for as long as it is there
  bool is_front = false;
  Twin twin;
  FrontGroup group;
};

/// A twin at a point: h psi and its gradient.
struct ScalarTerm {
  int function;
  double value;
  Vector3 gradient;
};
/// A front group at a point: what its three unknowns do.
struct FrontTerm {
  int function;
  Matrix3 value;                   // columns: modes
  std::array<Matrix3, 3> gradient; // of every mode, du_i/dx_j, 1/m
};
struct CutTerms {
  std::vector<ScalarTerm> scalar;
  std::vector<FrontTerm> front;
  void clear() {
    scalar.clear();
    front.clear();
  }
};

/// Place of a part with respect to the front, and the near-tip fields there.
struct PlacedFields {
  std::optional<FrontPlace> place;
  TipFields tip;
  // The fields as the station had them that was asked for last: its rings follow one another.
  FrontStation station; // of no spacing: none yet
  FrontFields fields;
};

class CutSpace {
 public:
  /// Base nodes and their spheres; all outlive this.
  CutSpace(const SmallBoxes& boxes, const topology::Domain& domain, const NodeCloud& nodes, const Spheres& spheres,
           const Material& material, CutSpaceOptions options);

  /// What an increment of the cut did to the functions.
  struct Change {
    std::vector<int> kept; // places of functions that go on as they were, in the list before; they come first, in order
    int added = 0;         // functions at the end of the list
  };
  /// Follows the cut to `incision`, which differs from the one before in `region` alone.
  Change update(std::shared_ptr<const topology::Incision> incision, const BoundingBox& region);

  [[nodiscard]] const std::vector<CutFunction>& functions() const { return functions_; }
  [[nodiscard]] const CutBoxes& cut() const { return cut_; }
  [[nodiscard]] const topology::Incision* incision() const { return incision_.get(); }
  /// Cells in which a function may differ from zero, ascending.
  [[nodiscard]] std::vector<int> cells_of(const CutFunction& function) const;
  /// Terms of the k-th function at a part of a box, with the box's linear shape functions. False: it vanishes there.
  bool term_at(int k, PartId part, ScalarTerm& term) const;
  /// Terms of a front group at all parts of a cell where it does not vanish, with the parts, ascending.
  void terms_in(int k, int cell, std::vector<PartId>& parts, std::vector<FrontTerm>& terms) const;
  /// All that do not vanish at x, in a part, with shape functions evaluated at x.
  void terms_at(const Vector3& x, PartId part, const ShapeFunctions& shape, CutTerms& terms) const;

 private:
  /// Boxes that the sphere of a node may reach, ascending; kept.
  [[nodiscard]] const std::vector<int>& boxes_in_reach(int node) const;
  void add_twins(int node, std::vector<CutFunction>& found) const;
  void find_curved_front();
  [[nodiscard]] FrontTerm front_term(int k, double value, const Vector3& gradient, PlacedFields& placed) const;
  [[nodiscard]] double step(const FrontPlace* place, const Vector3& x, double length, Vector3& gradient) const;
  /// Place of a part with respect to the front, kept until the front about it changes.
  [[nodiscard]] PlacedFields& place_of(PartId part) const;

  const SmallBoxes& boxes_;
  const NodeCloud& nodes_;
  const Spheres& spheres_;
  Material material_;
  CutSpaceOptions options_;
  CutBoxes cut_;
  std::shared_ptr<const topology::Incision> incision_;
  std::vector<CutFunction> functions_;
  std::vector<std::vector<int>> twins_of_, groups_of_; // places in functions_ by node
  std::vector<std::vector<double>> group_weights_;
  std::vector<Vector3> origins_;                              // of the runs of the front
  mutable std::vector<std::unique_ptr<PlacedFields>> places_; // by part; null: not asked for yet
  mutable std::vector<PartId> placed_;                        // those that are there
  mutable std::vector<int> local_;                            // of a part among those of a sphere, -1 between calls
  mutable std::vector<std::vector<int>> reach_;               // by node, found as they are asked for
  std::vector<char> curved_;                                  // by segment of the front: its run is curved
  double front_reach_ = 0; // m, from a front to the farthest place that its functions come to
  int next_id_ = 0;
};

} // namespace spherecut::solvers
