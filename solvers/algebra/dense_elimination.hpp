// A small dense system that is filled, solved once and filled again, as in a real-time step: Gaussian elimination with
// partial pivoting in memory of its own. Uses AVX2 or AVX-512 where the machine has them.
#pragma once

#include <array>
#include <vector>

namespace spherecut::solvers {

struct EliminationResult {
  bool regular = false;   // false when a pivot is zero or not finite
  double pivot_ratio = 0; // largest over smallest |pivot|: a rough, cheap stand-in for the condition
};

/// A X = B. Nothing but the constructor allocates.
class DenseSystem {
 public:
  static constexpr int most_right = 8;
  /// n unknowns, up to most_right right-hand sides. Throws InputError when either is out of range.
  DenseSystem(int unknowns, int right_hand_sides);

  /// All entries zero.
  void clear() noexcept;
  /// Row i of [A | B]: n + right entries.
  [[nodiscard]] double* row(int i) noexcept { return matrix_.data()->data() + static_cast<std::ptrdiff_t>(i) * width_; }
  /// Destroys the rows. The solution is meaningless when the result is not regular.
  EliminationResult solve() noexcept;
  /// The same by the code compiled for any machine, for comparison.
  EliminationResult solve_portable() noexcept;
  /// Entry of X.
  [[nodiscard]] double solution(int i, int column) const noexcept { return solution_[i][column]; }

 private:
  struct alignas(64) Block : std::array<double, 8> {};
  int n_, right_, width_;
  std::vector<Block> matrix_, panel_, solution_;
};

} // namespace spherecut::solvers
