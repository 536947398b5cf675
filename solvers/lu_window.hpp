// A general system of which only a window changes: all other unknowns are eliminated once, and what remains is a dense
// matrix small enough to be factored again at every increment of a cut. What schur_window.hpp does for a symmetric one.
//
// With the far unknowns F and the window W, S = A_WW - A_WF A_FF^-1 A_FW. A row of A that changes must lie in the
// window with all its columns; it is then a row of S as it is. Slots of the window: the unknowns given, then room for
// unknowns to come.
#pragma once

#include "solvers/partial_factorisation.hpp"

namespace spherecut::solvers {

class LuWindow {
 public:
  /// `window`: unknowns of A, in the order of their slots. `room`: further slots, inactive until activated. Throws
  /// NumericalError when A_FF is singular.
  LuWindow(const SparseMatrix& matrix, std::vector<int> window, int room, const std::vector<int>& ordering = {});

  /// Condition of A as it was given (solvers::condition_estimate). Needs factor().
  [[nodiscard]] double condition_estimate() const;
  /// Entries of the factors and of the window.
  [[nodiscard]] long factor_nonzeros() const { return far_->nonzeros(); }

  [[nodiscard]] int slots() const { return static_cast<int>(schur_.rows()); }
  [[nodiscard]] bool active(int slot) const { return active_[slot] != 0; }
  /// Whether the row of A at a slot has columns outside the window: it cannot change.
  [[nodiscard]] bool leads_far(int slot) const {
    return slot < to_far_.rows() && to_far_.outerIndexPtr()[slot] < to_far_.outerIndexPtr()[slot + 1];
  }

  /// A new unknown: its row and column start at zero.
  void activate(int slot);
  /// Takes an unknown out of the system; its row and column are forgotten.
  void deactivate(int slot);
  /// The row of A at a slot becomes zero but for what is added to it next. The row must not lead far.
  void clear_row(int slot) { schur_.row(slot).setZero(); }
  void add(int slot, int column_slot, double value) { schur_(slot, column_slot) += value; }

  /// Factors the active part of S. Throws NumericalError where it is singular to rounding.
  void factor();
  /// Unknowns of the last factor().
  [[nodiscard]] int factored() const { return static_cast<int>(order_.size()); }

  /// Right-hand sides by slots that the window sees when `right` (rows by unknowns of A, those of the window are not
  /// read) acts on the far unknowns.
  [[nodiscard]] MatrixX reduce(const MatrixX& right, bool transposed = false) const;
  /// S^-1 right, or S^-T right, by slots; inactive slots are zero. Needs factor().
  [[nodiscard]] MatrixX solve(const MatrixX& right, bool transposed = false) const;
  /// The far unknowns (rows by unknowns of A, zero in the window) from the window's and the right-hand sides given to
  /// reduce().
  [[nodiscard]] MatrixX recover(const MatrixX& window, const MatrixX& right, bool transposed = false) const;

 private:
  using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  std::vector<int> window_;
  double norm_;           // of A
  RowMajor to_far_;       // A_WF: rows by slots, columns by unknowns of A
  SparseMatrix from_far_; // A_FW: rows by unknowns of A, columns by slots
  std::unique_ptr<PartialFactorisation> far_;
  MatrixX schur_;            // by slots
  std::vector<char> active_; // by slot
  std::vector<int> order_;   // slots at the last factor()
  MatrixX factor_;           // their L U
  std::vector<int> pivots_;  // of LAPACK
};

} // namespace spherecut::solvers
