// A general system of which only a window changes: all other unknowns are eliminated once, and what remains is a dense
// matrix small enough to be factored again at every increment of a cut. What schur_window.hpp does for a symmetric one.
//
// With the far unknowns F and the window W, S = A_WW - A_WF A_FF^-1 A_FW. A row of A that changes must lie in the
// window with all its columns; it is then a row of S as it is, and sparse. So the rows A that the next increments will
// not change can be eliminated ahead together with their columns, X = S_AA^-1 S_AK: of the kept ones, whose rows may
// change, S_KK - S_KA X is left to be factored, a sparse matrix times one that stands. Slots of the window: the
// unknowns given, then room for unknowns to come.
#pragma once

#include "solvers/algebra/partial_factorisation.hpp"

namespace spherecut::solvers {

class LuWindow {
 public:
  /// `window`: unknowns of A, in the order of their slots. `room`: further slots, inactive until activated. Throws
  /// NumericalError when A_FF is singular.
  LuWindow(const SparseMatrix& matrix, std::vector<int> window, int room, const std::vector<int>& ordering = {});

  /// Condition of A as it was given (solvers::condition_estimate). After factor(), before any prepare().
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
  /// Takes an unknown out of the system. No row that stays active may have an entry in its column.
  void deactivate(int slot);
  /// The row of A at a slot becomes zero but for what is added to it next. The row must not lead far.
  void clear_row(int slot) {
    schur_.row(slot).setZero();
    changed_[slot] = 1;
  }
  void add(int slot, int column_slot, double value) {
    schur_(slot, column_slot) += value;
    changed_[slot] = 1;
  }
  /// Whether the row at the slot has changed since the last factor().
  [[nodiscard]] bool changed(int slot) const { return changed_[slot] != 0; }

  /// Eliminates the active unknowns that are not marked in `kept` (by slot) or whose rows lead far, then factors the
  /// rest. What is eliminated stays until a row of it changes: later factor() have only the kept unknowns, and those in
  /// the room, left to do. Throws as factor().
  void prepare(const std::vector<char>& kept);
  /// Whether something is eliminated ahead and no row of it has changed.
  [[nodiscard]] bool is_prepared() const;

  /// Factors the active part of S. Throws NumericalError where it is singular to rounding.
  void factor();
  /// Unknowns that the last factor() had to do, and those done ahead.
  [[nodiscard]] int factored() const { return static_cast<int>(rest_.slots.size()); }
  [[nodiscard]] int done_ahead() const { return static_cast<int>(ahead_.slots.size()); }

  /// Right-hand sides by slots that the window sees when `right` (rows by unknowns of A, those of the window are not
  /// read) acts on the far unknowns.
  [[nodiscard]] MatrixX reduce(const MatrixX& right, bool transposed = false) const;
  /// S^-1 right, or S^-T right, by slots; inactive slots are zero. Needs factor(); the transposed one before any
  /// prepare().
  [[nodiscard]] MatrixX solve(const MatrixX& right, bool transposed = false) const;
  /// F^T S^-1 right of functionals F and right-hand sides by slots. What both see of the part done ahead is kept for
  /// the next call.
  [[nodiscard]] MatrixX condense(const MatrixX& functionals, const MatrixX& right);
  /// The far unknowns (rows by unknowns of A, zero in the window) from the window's and the right-hand sides given to
  /// reduce().
  [[nodiscard]] MatrixX recover(const MatrixX& window, const MatrixX& right, bool transposed = false) const;

 private:
  using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  /// Some slots of S among themselves: L U of the transpose.
  struct Part {
    std::vector<int> slots;
    MatrixX factor;
    std::vector<int> pivots; // of LAPACK
    void factorise(const VectorX& scale);
    void solve(MatrixX& x, bool transposed) const;
  };
  /// A row of S at the columns done ahead.
  struct SparseRow {
    std::vector<int> places; // in ahead_
    std::vector<double> values;
  };
  void gather(Part& part, VectorX& scale) const;
  void take_from_kept(const std::vector<int>& places);
  [[nodiscard]] MatrixX rows_of(const std::vector<int>& slots, const MatrixX& right) const;
  /// rows of rest_ -= S_KA y, y by places in ahead_.
  void subtract_ahead(const MatrixX& y, MatrixX& rest) const;
  /// By places in kept_ from rows of rest_.
  [[nodiscard]] MatrixX by_kept(const MatrixX& rest) const;

  std::vector<int> window_;
  double norm_;           // of A
  RowMajor to_far_;       // A_WF: rows by slots, columns by unknowns of A
  SparseMatrix from_far_; // A_FW: rows by unknowns of A, columns by slots
  std::unique_ptr<PartialFactorisation> far_;
  RowMatrix schur_;                                   // by slots
  std::vector<char> active_, changed_, active_ahead_; // by slot; since factor(); at prepare()
  Part ahead_, rest_;
  std::vector<int> kept_, kept_place_, ahead_place_; // slots; place of a slot in them, -1 outside
  MatrixX beside_;                                   // X^T: kept x ahead
  std::vector<SparseRow> kept_rows_;                 // S_KA
  MatrixX taken_;                                    // (S_KA X)^T
  struct SeenAhead {
    MatrixX functionals, right; // ahead x count
    MatrixX solved;             // S_AA^-1 right
    MatrixX response, beside;   // F^T of it, F^T X
  } seen_;
};

} // namespace spherecut::solvers
