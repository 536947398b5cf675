// Assembly of the tangent of a body at finite strain as a sparse matrix in elimination order.
#pragma once

#include "solvers/finite/body.hpp"

namespace spherecut::solvers {

/// Which nodes couple, the order of elimination, and the sums over points. Belongs to one body.
class FiniteTangent {
 public:
  explicit FiniteTangent(const FiniteBody& body);

  [[nodiscard]] const std::vector<int>& rank() const { return rank_; }

  /// `deformation`: F of all groups; `jacobian`: mean J of all blocks.
  void assemble(const std::vector<LaneValues>& deformation, const std::vector<double>& jacobian, double penalty,
                SparseMatrix& lower) const;

 private:
  struct Local {
    std::vector<int> ranks;
    MatrixX matrix;
  };
  void find_pattern();
  void lay_pattern(SparseMatrix& lower) const;
  void add_groups(const std::vector<LaneValues>& deformation, const std::vector<double>& jacobian,
                  std::vector<VectorX>& swelling, SparseMatrix& lower) const;
  void add_blocks(const std::vector<double>& jacobian, const std::vector<VectorX>& swelling, SparseMatrix& lower) const;
  void add_penalties(double penalty, SparseMatrix& lower) const;
  void add_support(SparseMatrix& lower) const;
  /// d(sum of w J)/du of a group, in its order of nodes, m2.
  [[nodiscard]] VectorX swelling_of(int group, const LaneValues* cofactor) const;
  /// w dP/dF at the points of a group, [row + 9 column], and w times the cofactors.
  static void point_tangents(const FiniteBody& body, int group, const LaneValues* deformation, double block_jacobian,
                             LaneValues* tangent, LaneValues* cofactor);
  friend std::optional<UniformTangent> uniform_tangent_of(const FiniteBody& body,
                                                          const std::vector<LaneValues>& deformation,
                                                          const std::vector<double>& jacobian);
  void group_matrix(int group, const LaneValues* tangent, Local& local) const;
  void add_uniform(const UniformTangent& uniform, std::vector<VectorX>& swelling, SparseMatrix& lower) const;
  /// Sum of w g_i g_j^T over the points of groups, 3 x 3 a pair; `place`: -1 a function, here and afterwards.
  void cell_moments(int first, int end, std::vector<int>& place, Local& local) const;
  /// Whether the points of a cell may be summed together.
  [[nodiscard]] bool sums_by_cell() const;
  template <class Visit>
  void for_each_pair(const std::vector<int>& ranks, Visit&& visit) const;
  /// Adds a 3 x 3 block per pair of the nodes, whose ranks ascend; `matrix` has 3 rows and columns a node, in that
  /// order.
  void scatter(const std::vector<int>& ranks, const MatrixX& matrix, SparseMatrix& lower) const;

  const FiniteBody& body_;
  std::vector<int> rank_;
  std::vector<std::vector<int>> block_groups_; // of every block
  std::vector<int> column_start_, rows_;       // pattern by ranks of nodes: lower, the diagonal first
};

/// As FiniteBody::uniform_tangent(), with F of all groups and the mean J of all blocks.
std::optional<UniformTangent> uniform_tangent_of(const FiniteBody& body, const std::vector<LaneValues>& deformation,
                                                 const std::vector<double>& jacobian);

} // namespace spherecut::solvers
