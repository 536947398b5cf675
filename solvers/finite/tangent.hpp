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
  void group_matrix(int group, const LaneValues* tangent, Local& local) const;
  /// Tangent and cofactors of a point of unit weight, where all points are alike: a body strained alike everywhere, as
  /// at rest, whose law is the same everywhere.
  struct Uniform {
    LaneValues tangent[81], cofactor[9]; // in the first lane
  };
  [[nodiscard]] std::unique_ptr<const Uniform> uniform_of(const std::vector<LaneValues>& deformation,
                                                          const std::vector<double>& jacobian) const;
  void group_matrix(int group, const Uniform& uniform, Local& local) const;
  void point_tangents(int group, const LaneValues* deformation, double block_jacobian, LaneValues* tangent,
                      LaneValues* cofactor) const;
  /// Adds a 3 x 3 block per pair of the nodes, whose ranks ascend; `matrix` has 3 rows and columns a node, in that
  /// order.
  void scatter(const std::vector<int>& ranks, const MatrixX& matrix, SparseMatrix& lower) const;

  const FiniteBody& body_;
  std::vector<int> rank_;
  std::vector<std::vector<int>> block_groups_; // of every block
  std::vector<int> column_start_, rows_;       // pattern by ranks of nodes: lower, the diagonal first
};

} // namespace spherecut::solvers
