// Shape functions of a body at finite strain whose cut only appends (sight rule `appended`). Those of the uncut body
// outlast every cut. A sheet that hides part of a sphere from its node gives the node a second vector unknown: the
// sphere's function h counts with the first on the node's side and with the second beyond the sheet,
//
//   u = sum_J h_J [(1 - psi_J) a_J + psi_J b_J].
//
// psi is 1 in what is hidden where the sheet parts the sphere [Hansbo and Hansbo 2004]. Where a front ends in the
// sphere it is (1 - step(x)) / 2 with the step of solvers/appended/cut_space.hpp, which opens like sqrt(r); likewise
// with b_J in place of a_J where it ends in what is hidden. So each unknown is strained and turned as its side is, and
// no field that knows of directions is needed: what the cut has opened may turn by any angle.
#pragma once

#include "solvers/appended/cut_space.hpp"
#include "solvers/body/surface_patches.hpp"
#include "solvers/points/consistent_gradients.hpp"

#include <memory>

namespace spherecut::solvers {

/// The uncut body: its nodes, spheres and small boxes, whose gradients fit the quadrature. Immutable.
class UncutFunctions {
 public:
  /// On the first `base` nodes of a problem; the others are lip nodes, places without spheres. Throws NumericalError
  /// where a support is not sound.
  UncutFunctions(const Problem& problem, int base, double support_radius, bool is_consistent);
  UncutFunctions(const UncutFunctions&) = delete;
  UncutFunctions& operator=(const UncutFunctions&) = delete;

  /// Whether another problem has the same uncut body.
  [[nodiscard]] bool fits(const Problem& problem, int base, double support_radius, bool is_consistent) const;

  [[nodiscard]] int size() const { return nodes_.size(); }
  [[nodiscard]] const NodeCloud& nodes() const { return nodes_; }
  [[nodiscard]] const Spheres& spheres() const { return spheres_; }
  [[nodiscard]] const SmallBoxes& boxes() const { return boxes_; }
  [[nodiscard]] const SurfacePatches& patches() const { return patches_; }
  [[nodiscard]] const ConsistencyReport& consistency() const { return consistency_; }

 private:
  std::shared_ptr<const topology::Domain> domain_;
  NodeCloud nodes_;
  double support_radius_;
  bool is_consistent_;
  Spheres spheres_;
  SmallBoxes boxes_;
  SurfacePatches patches_;
  ConsistencyReport consistency_;
};

class CutFunctions {
 public:
  /// On the cut of the problem, whose first nodes are those of the uncut body.
  CutFunctions(std::shared_ptr<const UncutFunctions> uncut, const Problem& problem);

  [[nodiscard]] const std::shared_ptr<const UncutFunctions>& uncut() const { return uncut_; }
  /// Vector unknowns: one a node of the uncut body, then those that the cut appends.
  [[nodiscard]] int size() const { return uncut_->size() + appended(); }
  [[nodiscard]] int appended() const { return static_cast<int>(kept_.size()); }
  /// Of the k-th that is appended.
  [[nodiscard]] const Twin& twin(int k) const { return space_.functions()[kept_[k]].twin; }
  /// The node whose sphere a function belongs to.
  [[nodiscard]] int node_of(int function) const {
    return function < uncut_->size() ? function : twin(function - uncut_->size()).node;
  }
  /// The function that counts less by what the k-th appended one counts: that of the same sphere on the near side.
  [[nodiscard]] int host_of(int k) const { return host_[k] < 0 ? twin(k).node : uncut_->size() + host_[k]; }
  /// The functions at x; those that vanish are left out. False: no sound support covers x.
  bool evaluate(const Vector3& x, ShapeFunctions& shape) const;

  /// Points of the small boxes, a box's part on each side of the cut, with the gradients of all functions there.
  /// `cells`: a box of the octree each, shared out among the cells that the cut divides it into.
  [[nodiscard]] PointTable tabulate(BackgroundCells& cells) const;

  /// Coefficients, m, 3 a function, of the state of another body of the same uncut one, whose cut is shorter. `is_new`,
  /// by function: it is another one than before, or was not there; its coefficients are those of what is most like it.
  [[nodiscard]] VectorX state_from(const CutFunctions& before, const VectorX& coefficients,
                                   std::vector<char>& is_new) const;

 private:
  struct Place { // a point of the quadrature
    PartId part;
    int sample;
    QuadraturePoint point;
  };
  [[nodiscard]] std::vector<Place> places_in(int cell) const;
  [[nodiscard]] std::vector<std::vector<Place>> sides_of(int cell) const;
  void append_groups(int cell, const std::vector<Place>& places, int cell_of_table, PointTable& table) const;
  [[nodiscard]] bool has_step(int cell) const;
  void find_kept();
  void list_by_place();
  void find_hosts();
  /// Gradient of the k-th appended function in a part that its sphere reaches, 1/m; of the sphere's: `whole`.
  [[nodiscard]] Vector3 gradient_beyond(int k, const Place& place, const Vector3& whole) const;

  std::shared_ptr<const UncutFunctions> uncut_;
  CutSpace space_;
  std::vector<int> kept_;                 // functions of the space that weigh
  std::vector<int> host_;                 // of these: the function that a step opens; -1: that of its sphere
  std::vector<std::vector<int>> of_node_; // of these, by node
  std::vector<std::vector<int>> in_cell_; // likewise, by cell of the small boxes
};

} // namespace spherecut::solvers
