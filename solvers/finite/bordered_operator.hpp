// The tangent at rest of a body whose cut appends, on the factor K0 = L L^T of the uncut body's. In displacements
// u_J = a_J of whole spheres and differences d_k of what is appended to its host, nothing of K0 changes but by terms of
// rank one: a cut parts blocks of mean dilatation and shares of what is held, so that some terms go and others come,
//
//   [K0   C]                                    S = D - W^T W,  W = L^-1 C,
//   [C^T  D] + sum_t sigma_t v_t v_t^T,         sigma_t = 1 or -1
//
// (a bordered system with Woodbury's formula for the terms). Columns of C and S belong to their functions alone: those
// of functions that stay as the cut grows are kept, and an increment costs what it appends.
#pragma once

#include "solvers/finite/body.hpp"

#include <mutex>

namespace spherecut::solvers {

/// Columns over the unknowns of the uncut body, in order of elimination, with their half solutions.
struct HalfSolutions {
  std::vector<int> key; // of every column, or three of them: equal ones may be of the same function, or term
  MatrixX columns, halves;
};

/// What the last cut appended.
struct KeptBorder {
  HalfSolutions functions; // C and W, three columns each
  MatrixX schur;           // S
  HalfSolutions terms;
};

/// The factored tangent at rest of an uncut body, for those that a cut appends to. Immutable but for what it keeps.
class UncutTangent {
 public:
  /// Of a body whose cut functions append nothing.
  UncutTangent(const FiniteBody& body, const UniformTangent& uniform, std::shared_ptr<const OrderedCholesky> factor);

  /// Whether the uncut part of another body on the same uncut functions has it, too.
  [[nodiscard]] bool fits(const FiniteBody& body, const UniformTangent& uniform) const;

  [[nodiscard]] const OrderedCholesky& factor() const { return *factor_; }
  [[nodiscard]] const std::vector<int>& rank() const { return rank_; }
  [[nodiscard]] const DilatationBlocks& blocks() const { return blocks_; } // by group of the uncut body

  /// Mean displacement of the k-th held share: nodes and weights.
  [[nodiscard]] const DisplacementMean& held(int k) const { return means_[k]; }
  [[nodiscard]] int held() const { return static_cast<int>(means_.size()); }
  [[nodiscard]] const Prescribed& entry(int k) const { return held_[k]; }

  /// The border that was kept last; null: none was.
  [[nodiscard]] std::shared_ptr<const KeptBorder> border() const;
  void keep(std::shared_ptr<const KeptBorder> border) const;

 private:
  UniformTangent uniform_;
  std::shared_ptr<const OrderedCholesky> factor_;
  std::vector<int> rank_;
  DilatationBlocks blocks_;
  std::vector<Prescribed> held_;
  std::vector<DisplacementMean> means_; // of these
  mutable std::mutex guard_;
  mutable std::shared_ptr<const KeptBorder> border_;
};

/// Rows and columns: 3 a function of the body, in their order.
class BorderedOperator : public Factorisation {
 public:
  /// `penalty`: as that of FiniteBody::tangent(). Throws NumericalError where what is appended is not positive
  /// definite.
  BorderedOperator(const FiniteBody& body, std::shared_ptr<const UncutTangent> uncut, const UniformTangent& uniform,
                   double penalty);

  [[nodiscard]] MatrixX solve(const MatrixX& right_hand_sides) const override;
  [[nodiscard]] MatrixX solve_transposed(const MatrixX& right_hand_sides) const override {
    return solve(right_hand_sides);
  }
  [[nodiscard]] long nonzeros() const override;

 private:
  /// Rows of the uncut body in order of elimination, then of what is appended.
  struct Columns {
    MatrixX base, cut;
  };
  struct Terms;
  void append_elastic(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner) const;
  void append_blocks(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner, Terms& terms) const;
  void append_held(double penalty, Terms& terms) const;
  [[nodiscard]] Columns columns(Eigen::Index count) const;
  /// Adds a vector in one unknown of a function to those of displacements of spheres and of differences.
  void add(int function, const Vector3& value, Eigen::Index column, Columns& to) const;
  /// The bordered L^-1 of loads, whose base rows are half solutions already.
  void forward_cut(Columns& columns) const;

  /// W and S of the functions, as far as those before do not tell them already.
  void border(MatrixX coupling, const MatrixX& corner, const KeptBorder* before, KeptBorder& now) const;

  const FiniteBody& body_;
  std::shared_ptr<const UncutTangent> uncut_;
  int base_, appended_;
  std::shared_ptr<const KeptBorder> border_;
  MatrixX lower_;       // Cholesky factor of S
  Columns terms_;       // half solutions of the terms
  MatrixX middle_back_; // of the terms: inverse of 1 / sigma + v^T K^-1 v
};

} // namespace spherecut::solvers
