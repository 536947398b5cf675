// The uncut body of method galerkin: nodes, spheres, small boxes, stiffness and its factor. A cut changes nothing of
// it.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/appended/small_boxes.hpp"
#include "solvers/body/discretisation.hpp"
#include "solvers/body/surface_patches.hpp"
#include "solvers/galerkin/stiffness_matrix.hpp"

namespace spherecut::solvers {

struct UncutOptions {
  double support_radius = 1.75; // rho, radius over galerkin_lengths
  double cell_size = 1;         // largest edge of a background cell in spacings; a small box has half of it
  bool estimate_condition = true;
};

class UncutBody {
 public:
  /// `problem` without its incision; its first `base` nodes have spheres, the others are places where something is
  /// asked for. Of the prescribed entries those of the first nodes hold the surface. Throws as discretise().
  UncutBody(Problem problem, int base, const UncutOptions& options);

  /// Whether it is the uncut body of this problem: equal nodes, material and held nodes.
  [[nodiscard]] bool fits(const Problem& problem, int base) const;
  [[nodiscard]] const Problem& problem() const { return problem_; }
  [[nodiscard]] const NodeCloud& nodes() const { return problem_.nodes; }
  [[nodiscard]] int size() const { return problem_.nodes.size(); }
  [[nodiscard]] const Spheres& spheres() const { return spheres_; }
  [[nodiscard]] const SmallBoxes& boxes() const { return boxes_; }
  [[nodiscard]] const std::vector<DisplacementMean>& held() const { return held_; } // by entry of problem().prescribed
  [[nodiscard]] const OrderedCholesky& factor() const { return *factor_; }
  [[nodiscard]] const std::vector<int>& rank() const { return rank_; }
  [[nodiscard]] const AssemblyReport& report() const { return report_; }
  /// Elastic stiffness times coefficients in node order, without the penalties of what is held.
  [[nodiscard]] VectorX elastic_forces(const VectorX& coefficients) const;
  /// Between node order and elimination order.
  [[nodiscard]] MatrixX ordered(const MatrixX& by_node) const;
  [[nodiscard]] MatrixX unordered(const MatrixX& by_rank) const;

 private:
  void assemble();
  void weigh(DisplacementMean& mean) const;

  Problem problem_;
  AssemblyReport report_;
  Spheres spheres_;
  SmallBoxes boxes_;
  std::vector<DisplacementMean> held_;
  std::vector<int> order_, rank_;
  SparseMatrix stiffness_;
  EntriesInLargePages elastic_;
  std::unique_ptr<OrderedCholesky> factor_;
};

} // namespace spherecut::solvers
