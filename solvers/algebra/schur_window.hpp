// A symmetric positive definite system of which only a window changes: all other unknowns are eliminated once, and what
// remains is a dense matrix small enough to be factored again at every increment of a cut.
//
// With the far unknowns F first and the window W last,
//
//   S = K_WW - K_WF K_FF^-1 K_FW = L_WW L_WW^T,
//
// L_WW being the trailing block of the sparse Cholesky factor. Entries of K between window unknowns change S by as
// much. Slots of the window: the unknowns that a cut may change, then room for unknowns to come, then those of the
// contact, whose condensed stiffness is then the trailing block of the dense factor. Between two increments the part of
// the window that the next one will not touch can be eliminated ahead, so that an increment itself factors no more than
// what it changes; in several stages, so that what most increments leave alone is not done again with what many do.
#pragma once

#include "solvers/algebra/factorisation.hpp"

namespace spherecut::solvers {

class SchurWindow {
 public:
  /// `lower`: lower triangle of K in elimination order, its last `changing + contact` unknowns the window. `room`:
  /// further slots, inactive until activated. Throws NumericalError when K is not positive definite, InputError when
  /// the counts do not fit.
  SchurWindow(const SparseMatrix& lower, int changing, int room, int contact);

  /// Condition of K as it was given (solvers::condition_estimate).
  [[nodiscard]] double condition_estimate() const;
  /// Nonzeros of the sparse factor.
  [[nodiscard]] long factor_nonzeros() const { return cholesky_->nonzeros(); }

  [[nodiscard]] int far() const { return far_; }
  [[nodiscard]] int slots() const { return static_cast<int>(schur_.rows()); }
  [[nodiscard]] int contact_begin() const { return changing_ + room_; }
  /// Slot of an unknown of K in elimination order, -1 for a far one.
  [[nodiscard]] int slot_of(int unknown) const {
    return unknown < far_ ? -1 : unknown - far_ + (unknown - far_ >= changing_ ? room_ : 0);
  }

  /// Column of S as it stands; entries from the diagonal down are meant to be changed, those above are not read. Counts
  /// as a change of the slot: whoever changes an entry asks for the columns of both its unknowns, as it must for their
  /// diagonals.
  [[nodiscard]] double* column(int slot) {
    changed_[slot] = 1;
    return schur_.data() + static_cast<std::ptrdiff_t>(slot) * schur_.rows();
  }
  [[nodiscard]] bool active(int slot) const { return active_[slot] != 0; }
  /// Whether the slot has changed since the last factor().
  [[nodiscard]] bool changed(int slot) const { return changed_[slot] != 0; }
  /// New unknowns: their rows and columns start at zero.
  void activate(const std::vector<int>& slots);
  /// Takes unknowns out of the system; their rows and columns are forgotten.
  void deactivate(const std::vector<int>& slots);

  /// Work done ahead of a change: eliminates what is active and not marked in the sets `kept` (by slot), one stage for
  /// each of them, so that the next factor() has only the unknowns marked in the last left to do, as long as nothing
  /// else has changed by then. Free room is kept whatever the marks say. Factors the rest as well: together that is the
  /// work of one factor(). What is done ahead stays until a change concerns it: of the stages that are there already
  /// those that eliminate no slot marked in the first set stay, below the new ones. Throws as factor().
  void prepare(const std::vector<std::vector<char>>& kept);
  /// Forgets the stages that a change has concerned, and those on top of them; how many are left.
  int keep_sound_stages();
  [[nodiscard]] int stages() const { return static_cast<int>(stages_.size()); }
  /// Whether no stage has eliminated the slot.
  [[nodiscard]] bool is_kept(int slot) const { return stages_.empty() || stages_.back().place[slot] != eliminated; }

  /// Factors the active part of S. Whether what was prepared could be used. Throws NumericalError naming the slot where
  /// S is not positive definite, or singular to rounding.
  bool factor();
  /// Unknowns that the last factor() had to do, and those done ahead.
  [[nodiscard]] int factored() const { return static_cast<int>(order_.size()); }
  [[nodiscard]] int done_ahead() const;

  /// Right-hand sides by slots that the window sees when `right` acts on K (elimination order); new slots get zero.
  /// `far` (may be null): the half of their solution that the far unknowns take part in, for products with others.
  [[nodiscard]] MatrixX reduce(const MatrixX& right, MatrixX* far = nullptr) const;
  /// S^-1 right, by slots; inactive slots are zero. Needs factor().
  [[nodiscard]] MatrixX solve(const MatrixX& right) const;

  /// F^T S^-1 F and F^T S^-1 right for functionals F (slots x count): what they see of unit loads on themselves and of
  /// a load. Cheap when F reaches late slots alone, such as those of the contact; what F sees of the part done ahead is
  /// kept for the next call.
  struct Condensed {
    MatrixX compliance; // count x count, symmetric
    VectorX response;   // count
  };
  [[nodiscard]] Condensed condense(const SparseMatrix& functionals, const VectorX& right);
  /// What condense() will see of the part done ahead, found now; functionals and loads that come otherwise are found
  /// again then, one by one.
  void see_ahead(const SparseMatrix& functionals, const VectorX& right);

  /// Half of S^-1 right, by slots as right: F^T S^-1 G is the product of their halves.
  struct Half {
    std::vector<MatrixX> ahead; // of what was done ahead, by stage
    MatrixX rest;               // of what was left to factor()
    [[nodiscard]] Half left_columns(Eigen::Index count) const;
  };
  [[nodiscard]] Half half(const MatrixX& right) const;
  [[nodiscard]] static MatrixX product(const Half& one, const Half& other);
  /// F^T S^-1 right from the half of right, for the functionals F of the last condense(): those of
  /// condensed_count(), none where there was a factor() since.
  [[nodiscard]] MatrixX seen_by_condensed(const Half& right) const;
  [[nodiscard]] Eigen::Index condensed_count() const { return condensed_rest_.cols(); }

  /// Solution in elimination order of K from that of the window (slots) and the right-hand sides given to reduce().
  [[nodiscard]] MatrixX recover(const MatrixX& window, const MatrixX& right) const;
  /// The same from the half that reduce() gave of the far unknowns.
  [[nodiscard]] MatrixX recover_from_half(const MatrixX& window, const MatrixX& far) const;

 private:
  static constexpr int eliminated = -1, free = -2;
  /// Done ahead: S of the slots `ahead`, less what the stages before eliminate, is `factor` squared; `coupling` (kept x
  /// ahead) are the rows of the kept slots below it. Their own part of S is to be less by `taken_off`, by this stage
  /// and those before. A slot that was free then has nothing to do with what is done ahead.
  struct Stage {
    std::vector<int> ahead, kept;        // slots
    std::vector<int> place, ahead_place; // of a slot in kept, or one of the above; in ahead, or -1
    std::vector<double> factor;          // column-major, ahead squared
    MatrixX coupling, taken_off;
    // What functionals and a load, the last column, see of it.
    SparseMatrix functionals; // that were seen, and the rows of the load
    VectorX load;
    MatrixX halfway, taken; // L^-1 of them, and what that takes from the kept slots, with the stages before
    MatrixX products;       // count + 1 squared, of this stage
    /// What it has taken from the row of a slot.
    void take_from(MatrixX& rows, Eigen::Index row, const MatrixX& all_taken, int slot) const {
      if (place[slot] >= 0)
        rows.row(row) -= all_taken.row(place[slot]);
    }
  };
  void add_stage(const std::vector<char>& kept);
  void gather(const std::vector<int>& slots, std::vector<double>& square) const;
  [[nodiscard]] MatrixX recover_from(MatrixX halfway, const MatrixX& window) const;

  int far_, changing_, room_, contact_;
  double norm_; // of K
  std::unique_ptr<OrderedCholesky> cholesky_;
  MatrixX trailing_;           // L_WW at construction
  MatrixX schur_;              // lower triangle, by slots
  std::vector<char> active_;   // by slot
  std::vector<char> changed_;  // by slot, since factor()
  std::vector<Stage> stages_;  // each of slots that the one before keeps
  MatrixX condensed_rest_;     // half of the functionals of the last condense(), last rows: those above are zero
  std::vector<int> order_;     // slots at the last factor(), but those done ahead
  std::vector<double> factor_; // their dense Cholesky factor, column-major, order_.size() squared
};

} // namespace spherecut::solvers
