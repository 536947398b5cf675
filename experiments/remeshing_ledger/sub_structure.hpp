// A body in two parts: the far one condensed once onto the nodes between, the near one, near the blade, factored at
// every increment together with that dense block.
#pragma once

#include "experiments/remeshing_ledger/fem_model.hpp"

#include <unordered_map>

namespace spherecut::experiments::ledger {

/// What a node stays known by while the mesh changes elsewhere: a corner by the vertex of the whole mesh and the side
/// of the cut, another node by its two corners.
using NodeKey = std::uint64_t;
std::vector<NodeKey> node_keys(const CutMesh& mesh, const FemNodes& nodes);

class SubStructure {
 public:
  /// `near`, by element: of the near part. Where too many nodes would lie between, or more than beyond, all are. Orders
  /// the unknowns, then assembles and factors the far part.
  void condense(const FemNodes& nodes, const Scenario& scenario, std::vector<char> near, StageTimes& times);
  /// Has the far part found again in other numberings of the nodes; after condense().
  void remember(const std::vector<NodeKey>& keys);
  /// Another mesh of the near part; the far part and the nodes between are those of remember(). Throws NumericalError
  /// where they are not all there.
  void renew(const FemNodes& nodes, const std::vector<NodeKey>& keys, std::vector<char> near, StageTimes& times);
  /// Displacements, 3 a node. Throws NumericalError where an element folds over and `strict`, or where the stiffness is
  /// not positive definite.
  const VectorX& solve(const FemNodes& nodes, const Scenario& scenario, bool strict, StageTimes& times);

  [[nodiscard]] const VectorX& displacement() const { return displacement_; }
  [[nodiscard]] bool is_near(std::size_t element) const { return near_[element] != 0; }
  [[nodiscard]] int unknowns() const { return 3 * (near_count_ + between_count_ + far_count_); }
  [[nodiscard]] double condition() const;

 private:
  void recover(const FemNodes& nodes, const VectorX& right);
  void add_dense(solvers::SparseMatrix& lower) const;

  std::vector<char> near_;                   // by element
  std::vector<int> near_place_, far_place_;  // by node, those between last in both; -1 elsewhere
  std::unordered_map<NodeKey, int> far_key_; // place among the far ones and those between
  int near_count_ = 0, between_count_ = 0, far_count_ = 0;
  std::unique_ptr<solvers::OrderedCholesky> far_, near_factor_;
  MatrixX root_, schur_;      // S = L_BB L_BB^T of the nodes between
  VectorX halfway_, reduced_; // L^-1 of the far loads; what they are to the nodes between
  VectorX displacement_;
  double near_norm_ = 0;
};

} // namespace spherecut::experiments::ledger
