// Prescribed displacements of a body at finite strain, met exactly. Every entry holds the mean displacement over a
// share of the surface along some axes, sum_J w_J u_J = g; the coefficients of one function an entry, its own,
// follow from the others.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/surface_patches.hpp"

namespace spherecut::solvers {

class HeldMeans {
 public:
  /// `means` and `own`, the functions whose coefficients follow, belong to the entries. Throws NumericalError where the
  /// means do not determine those coefficients.
  HeldMeans(std::vector<Prescribed> entries, std::vector<DisplacementMean> means, const std::vector<int>& own,
            int functions);

  [[nodiscard]] const std::vector<Prescribed>& entries() const { return entries_; }
  [[nodiscard]] const std::vector<DisplacementMean>& means() const { return means_; }

  /// Sets the coefficients of held nodes such that the means are `values` (one per entry), or zero when it is empty.
  void complete(VectorX& coefficients, std::span<const Vector3> values) const;

  /// Forces on the coefficients, conjugate to them, with those of held nodes passed on to the others as far as these
  /// move them: zero in held rows. Returns what the constraints exert on the body, one per entry, N.
  std::vector<Vector3> reduce(VectorX& forces) const;

  /// Zeros in held rows.
  void clear_held(VectorX& v) const;

 private:
  /// Axes that the same entries hold.
  struct Axes {
    std::vector<int> axes, entries, nodes;
    SparseMatrix others; // of what is not held, entries x functions of the body
    std::unique_ptr<Factorisation> own;
  };
  std::vector<Prescribed> entries_;
  std::vector<DisplacementMean> means_;
  std::vector<Axes> groups_;
};

} // namespace spherecut::solvers
