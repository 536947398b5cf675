// A symmetric positive definite system of which only a window changes: all other unknowns are eliminated once, and what
// remains is a dense matrix small enough to be factored again at every increment of a cut.
//
// With the far unknowns F first and the window W last,
//
//   S = K_WW - K_WF K_FF^-1 K_FW = L_WW L_WW^T,
//
// L_WW being the trailing block of the sparse Cholesky factor. Entries of K between window unknowns change S by as
// much. Slots of the window: the unknowns that a cut may change, then room for unknowns to come, then those of the
// contact, whose condensed stiffness is then the trailing block of the dense factor.
#pragma once

#include "solvers/factorisation.hpp"

namespace spherecut::solvers {

class SchurWindow {
 public:
  /// `lower`: lower triangle of K in elimination order, its last `changing + contact` unknowns the window. `room`:
  /// further slots, inactive until activated. Throws NumericalError when K is not positive definite, InputError when
  /// the counts do not fit.
  SchurWindow(const SparseMatrix& lower, int changing, int room, int contact);

  [[nodiscard]] int far() const { return far_; }
  [[nodiscard]] int slots() const { return static_cast<int>(schur_.rows()); }
  [[nodiscard]] int contact_begin() const { return changing_ + room_; }
  /// Slot of an unknown of K in elimination order, -1 for a far one.
  [[nodiscard]] int slot_of(int unknown) const {
    return unknown < far_ ? -1 : unknown - far_ + (unknown - far_ >= changing_ ? room_ : 0);
  }

  /// Column of S as it stands; entries from the diagonal down are meant to be changed, those above are not read.
  [[nodiscard]] double* column(int slot) { return schur_.data() + static_cast<std::ptrdiff_t>(slot) * schur_.rows(); }
  [[nodiscard]] bool active(int slot) const { return active_[slot] != 0; }
  /// A new unknown: its row and column start at zero.
  void activate(int slot);
  /// Takes an unknown out of the system; its row and column are forgotten.
  void deactivate(int slot);

  /// Factors the active part of S. Throws NumericalError naming the slot where it is not positive definite.
  void factor();

  /// Right-hand sides by slots that the window sees when `right` acts on K (elimination order); new slots get zero.
  [[nodiscard]] MatrixX reduce(const MatrixX& right) const;
  /// S^-1 right, by slots; inactive slots are zero. Needs factor().
  [[nodiscard]] MatrixX solve(const MatrixX& right) const;
  /// Contact part of S^-1 right for right-hand sides that act on the contact slots alone (rows: those slots).
  [[nodiscard]] MatrixX solve_contact(const MatrixX& right) const;
  /// Solution in elimination order of K from that of the window (slots) and the right-hand sides given to reduce().
  [[nodiscard]] MatrixX recover(const MatrixX& window, const MatrixX& right) const;

 private:
  int far_, changing_, room_, contact_;
  std::unique_ptr<OrderedCholesky> cholesky_;
  MatrixX trailing_;           // L_WW at construction
  MatrixX schur_;              // lower triangle, by slots
  std::vector<char> active_;   // by slot
  std::vector<int> order_;     // active slots at the last factor()
  std::vector<double> factor_; // their dense Cholesky factor, column-major, order_.size() squared
  int contact_size_ = 0;       // active contact slots, at the end of order_
};

} // namespace spherecut::solvers
