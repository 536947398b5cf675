// The body of method `collocation` (balance_rows.hpp). Private to its sources.
#pragma once

#include "solvers/collocation/balance_rows.hpp"
#include "solvers/collocation/collocation.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

inline constexpr double mixed_above = 0.40; // Poisson ratio from which the pressure unknown is used

inline constexpr double default_collocation_radius = 1.8; // spacings

class Collocation final : public ElasticBody {
 public:
  /// Assembles and factors.
  Collocation(Problem problem, const DiscretisationOptions& options);

  Method method() const override { return Method::collocation; }
  [[nodiscard]] CellBalance cell_balance() const;
  Field solve() const override { return solve_for(loads_, 1, prescribed_values(problem_)); }
  double load_work(const Field& field) const override;
  std::vector<Field> force_responses(const std::vector<int>& candidates) const override;
  std::vector<Field> case_responses(const std::vector<int>& nodes, const MatrixX& forces) const override;
  std::vector<Field> pattern_responses(const std::vector<ForcePattern>& patterns) const override;
  Field prescribed_response(const std::vector<Vector3>& values) const override {
    return solve_for({}, 0, prescribed_values(problem_, values));
  }
  std::vector<Vector3> constraint_forces(const Field& field) const override;
  double residual(const Field& field, const std::vector<int>& loaded_nodes,
                  const std::vector<Vector3>& nodal_forces) const override;

 private:
  [[nodiscard]] std::vector<Field> responses_to(const MatrixX& right) const;
  void find_constrained();
  /// Which nodes couple, in compressed rows.
  struct NodeGraph {
    std::vector<int> start, neighbours;
  };
  [[nodiscard]] NodeGraph coupled_nodes() const;
  /// Of the unknowns, from the graph of the nodes: a tenth of the work that their own graph would be.
  [[nodiscard]] std::vector<int> elimination_order(const NodeGraph& graph) const;
  /// Finds the pieces; springs hold those that nothing holds, or their unknowns are dropped.
  void treat_pieces(const NodeGraph& graph, UnheldPieces unheld);
  [[nodiscard]] SparseMatrix constrained_system() const;
  /// Rows of node i in it: visit(row 0 to 3, column, value).
  template <typename Visit>
  void visit_rows(int i, const Visit& visit) const;
  /// Cells that a force on a node acts on, with their parts of it: its own, and those of nodes within the body that
  /// reach the surface nearest to it between the nodes of a coarse set.
  struct CellShare {
    int cell;
    double part;
  };
  [[nodiscard]] std::vector<std::vector<CellShare>> loaded_cells(const std::vector<int>& nodes) const;
  /// Stress of a strain as far as the displacements carry it: without the pressure where that is an unknown.
  [[nodiscard]] Matrix3 stress_of(const Matrix3& strain) const {
    const double lambda = mixed_ ? 0 : problem_.material.lame_lambda();
    return lambda * strain.trace() * Matrix3::Identity() +
           problem_.material.shear_modulus() * (strain + strain.transpose());
  }
  [[nodiscard]] double constraint_scale(int node) const {
    return problem_.material.young_modulus * problem_.nodes.spacings[node];
  }
  [[nodiscard]] Matrix3 anchor_stiffness(const Anchor& anchor) const {
    return constraint_scale(anchor.node) * anchor.direction * anchor.direction.transpose();
  }
  [[nodiscard]] double continuity_scale(int node) const {
    return problem_.material.shear_modulus() / problem_.nodes.spacings[node];
  }
  [[nodiscard]] double pressure_scale(int node) const { // Pa per unit of the pressure's unknown, a length
    return problem_.material.young_modulus / problem_.nodes.spacings[node];
  }
  [[nodiscard]] double expansion(int node, double load_factor) const { // right-hand side of the continuity, m3
    return load_factor * problem_.loads.initial_strain.trace() * cells_.volumes[node];
  }
  [[nodiscard]] VectorX right_hand_side(const std::vector<Vector3>& forces) const {
    VectorX right = VectorX::Zero(report_.unknowns);
    for (std::size_t i = 0; i < forces.size(); ++i)
      for (int c = 0; c < 3; ++c)
        if (!constrained_[i][c])
          right[stride_ * static_cast<Eigen::Index>(i) + c] = forces[i][c];
    return right;
  }
  [[nodiscard]] Field solve_for(const std::vector<Vector3>& forces, double load_factor,
                                const VectorX& prescribed) const {
    VectorX right = right_hand_side(forces);
    for (int i = 0; mixed_ && i < problem_.nodes.size(); ++i)
      right[stride_ * i + 3] = dropped_[i] != 0 ? 0 : continuity_scale(i) * expansion(i, load_factor);
    for (std::size_t k = 0; k < problem_.prescribed.size(); ++k) {
      const Prescribed& entry = problem_.prescribed[k];
      for (int c = 0; c < 3; ++c)
        if (entry.components[c])
          right[stride_ * entry.node + c] =
              constraint_scale(entry.node) * prescribed[3 * static_cast<Eigen::Index>(k) + c];
    }
    return field_of(factorisation_->solve(right).col(0), load_factor, prescribed);
  }
  [[nodiscard]] Field field_of(const VectorX& unknowns, double load_factor, const VectorX& prescribed) const {
    const int count = problem_.nodes.size();
    Field field;
    field.load_factor = load_factor;
    field.prescribed = prescribed;
    field.coefficients.resize(3 * count);
    if (mixed_)
      field.pressure.resize(count);
    for (int i = 0; i < count; ++i) {
      field.coefficients.segment<3>(3 * i) = unknowns.segment<3>(stride_ * i);
      if (mixed_)
        field.pressure[i] = pressure_scale(i) * unknowns[stride_ * i + 3];
    }
    require_finite(field, report_);
    return field;
  }
  /// Unreplaced balance of cell i: the force that must act on it from outside the body for the field to be in balance.
  [[nodiscard]] Vector3 balance(int i, const Field& field) const {
    Vector3 force = Vector3::Zero();
    const BalanceRow& row = rows_[i];
    for (std::size_t k = 0; k < row.nodes.size(); ++k) {
      force += row.blocks[k].topLeftCorner<3, 3>() * field.coefficients.segment<3>(3 * Eigen::Index{row.nodes[k]});
      if (mixed_)
        force += row.blocks[k].block<3, 1>(0, 3) * field.pressure[row.nodes[k]];
    }
    return force;
  }
  /// What the continuity of cell i misses, m3.
  [[nodiscard]] double discontinuity(int i, const Field& field) const {
    double missing = -expansion(i, field.load_factor);
    const BalanceRow& row = rows_[i];
    for (std::size_t k = 0; k < row.nodes.size(); ++k)
      missing += row.blocks[k].block<1, 3>(3, 0).dot(field.coefficients.segment<3>(3 * Eigen::Index{row.nodes[k]})) +
                 row.blocks[k](3, 3) * field.pressure[row.nodes[k]];
    return missing;
  }

  bool mixed_;
  int stride_;
  topology::CellComplex cells_;
  std::vector<std::array<bool, 3>> constrained_; // or dropped
  std::vector<Anchor> anchors_;                  // springs E h that hold pieces, part of the blocks
  std::vector<char> dropped_;                    // per node: its piece is held by nothing and taken out
  std::vector<Vector3> loads_;                   // N, loads on each cell
  std::vector<BalanceRow> rows_;
  std::unique_ptr<Factorisation> factorisation_;
};

template <typename Visit>
void Collocation::visit_rows(int i, const Visit& visit) const {
  for (int c = 0; c < stride_; ++c) {
    if (dropped_[i] != 0) {
      visit(c, stride_ * i + c, constraint_scale(i));
      continue;
    }
    if (c < 3 && constrained_[i][c]) {
      for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
        visit(c, stride_ * supports_.nodes[k] + c, constraint_scale(i) * supports_.value[k]);
      continue;
    }
    const double scale = c == 3 ? continuity_scale(i) : 1;
    const BalanceRow& row = rows_[i];
    for (std::size_t k = 0; k < row.nodes.size(); ++k)
      for (int e = 0; e < stride_; ++e)
        visit(c, stride_ * row.nodes[k] + e, scale * (e == 3 ? pressure_scale(row.nodes[k]) : 1) * row.blocks[k](c, e));
  }
}

} // namespace spherecut::solvers
