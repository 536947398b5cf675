// The tangent at rest of a body whose cut appends, on the factor K0 = L L^T of the uncut body's. In displacements
// u_J = a_J of whole spheres and differences d_k of what is appended to its host, nothing of K0 changes but by terms of
// rank one: a cut parts blocks of mean dilatation and shares of what is held, so that some terms go and others come,
//
//   [K0   C]                                    S = D - W^T W,  W = L^-1 C,
//   [C^T  D] + sum_t sigma_t v_t v_t^T,         sigma_t = 1 or -1
//
// (a bordered system with Woodbury's formula for the terms). A column of C belongs to its function alone: where the
// function stays as the cut grows, the half solution W of it does, too. But for the support of what is appended, which
// holds differences in place of the functions themselves, it is FiniteBody::tangent().
#pragma once

#include "solvers/finite/body.hpp"
#include "solvers/finite/cut_lineage.hpp"

namespace spherecut::solvers {

/// Columns over the unknowns of the uncut body, in order of elimination, with their half solutions.
struct HalfSolutions {
  /// Of every column, or of three: 2 node + 1 of a step, 2 node of another function; of a term its block, or -1 less
  /// its held share. Those of the same function, or term, have the same.
  std::vector<int> key;
  MatrixX columns, halves;
};

/// What the last cut appended.
struct KeptBorder {
  HalfSolutions functions; // C and W, three columns each
  MatrixX products;        // W^T W
  HalfSolutions terms;
};

/// The factored tangent at rest of an uncut body, for those that a cut appends to. Immutable.
class UncutTangent {
 public:
  /// Of a body without a cut; `norm`: one-norm of the matrix.
  UncutTangent(const FiniteBody& body, const UniformTangent& uniform, std::shared_ptr<const OrderedCholesky> factor,
               double norm);

  /// Whether the uncut part of another body on the same uncut functions has it, too.
  [[nodiscard]] bool fits(const FiniteBody& body, const UniformTangent& uniform) const;

  /// Several threads may use it at once: forward_sparse() and backward() alone.
  [[nodiscard]] const OrderedCholesky& factor() const { return *factor_; }
  [[nodiscard]] double norm() const { return norm_; }
  [[nodiscard]] const std::vector<int>& rank() const { return rank_; }
  [[nodiscard]] const DilatationBlocks& blocks() const { return blocks_; } // by group of the uncut body
  /// Held shares, and their mean displacements.
  [[nodiscard]] const std::vector<Prescribed>& shares() const { return shares_; }
  [[nodiscard]] const std::vector<DisplacementMean>& means() const { return means_; }

 private:
  UniformTangent uniform_;
  std::shared_ptr<const OrderedCholesky> factor_;
  std::vector<int> rank_;
  DilatationBlocks blocks_;
  double norm_;
  std::vector<Prescribed> shares_;
  std::vector<DisplacementMean> means_;
};

/// Rows and columns: 3 a function of the body, in their order.
class BorderedOperator : public Factorisation {
 public:
  /// `before`: of the body with a shorter cut, or null. `penalty`: as that of FiniteBody::tangent(). The body must
  /// outlive this. Throws NumericalError where the whole is not positive definite.
  BorderedOperator(const FiniteBody& body, std::shared_ptr<const UncutTangent> uncut, const KeptBorder* before,
                   const UniformTangent& uniform, double penalty);

  [[nodiscard]] MatrixX solve(const MatrixX& right_hand_sides) const override;
  [[nodiscard]] MatrixX solve_transposed(const MatrixX& right_hand_sides) const override {
    return solve(right_hand_sides);
  }
  [[nodiscard]] long nonzeros() const override;
  [[nodiscard]] const std::shared_ptr<const KeptBorder>& border() const { return border_; }
  /// Functions whose half solutions were there before.
  [[nodiscard]] int kept() const { return kept_; }

 private:
  /// Rows of the uncut body in order of elimination, then of what is appended.
  struct Columns {
    MatrixX base, cut;
  };
  struct Terms;
  void append_elastic(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner) const;
  void append_blocks(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner, Terms& come, Terms& gone) const;
  void append_held(double penalty, Terms& come, Terms& gone) const;
  /// W of the functions and W^T W, as far as those before do not tell them already.
  void find_halves(MatrixX coupling, const KeptBorder* before, KeptBorder& now);
  void factor_terms();
  [[nodiscard]] Columns columns(Eigen::Index count) const;
  /// Adds a vector in one unknown of a function to those of displacements of spheres and of differences.
  void add(int function, const Vector3& value, Eigen::Index column, Columns& to) const;
  /// The bordered L^-1 of loads, whose base rows are half solutions already.
  void forward_cut(Columns& columns) const;

  const FiniteBody& body_;
  std::shared_ptr<const UncutTangent> uncut_;
  int base_, appended_, kept_ = 0;
  std::shared_ptr<const KeptBorder> border_;
  MatrixX lower_; // Cholesky factor of S
  Columns terms_; // half solutions of the terms: those that come, then those that go
  int come_ = 0;
  MatrixX terms_lower_; // L of 1 / sigma + v^T K^-1 v = L diag(1, -1) L^T
};

} // namespace spherecut::solvers
