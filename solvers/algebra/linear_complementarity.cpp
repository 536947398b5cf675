#include "solvers/algebra/linear_complementarity.hpp"

#include <Eigen/LU>
#include <limits>

namespace spherecut::solvers {

ComplementaritySolution solve_complementarity(const MatrixX& matrix, const VectorX& gap, const std::vector<char>& start,
                                              double tolerance) {
  const Eigen::Index size = gap.size();
  ComplementaritySolution solution;
  solution.forces = VectorX::Zero(size);
  solution.active = start;
  solution.active.resize(static_cast<std::size_t>(size), 0);
  Eigen::Index fewest = std::numeric_limits<Eigen::Index>::max();
  int patience = 8; // block steps without progress before single pivots take over
  const int limit = 100 + 20 * static_cast<int>(size);
  std::vector<Eigen::Index> chosen;
  while (solution.pivots < limit) {
    chosen.clear();
    for (Eigen::Index k = 0; k < size; ++k)
      if (solution.active[k])
        chosen.push_back(k);
    solution.forces.setZero();
    if (!chosen.empty()) {
      const MatrixX pressed = matrix(chosen, chosen);
      const VectorX depth = -gap(chosen);
      const VectorX forces = pressed.partialPivLu().solve(depth);
      for (std::size_t a = 0; a < chosen.size(); ++a)
        solution.forces[chosen[a]] = forces[static_cast<Eigen::Index>(a)];
    }
    const VectorX open = matrix * solution.forces + gap;
    // A force is negligible when the gap it closes is: scaled by the node's own compliance.
    const auto wrong = [&](Eigen::Index k) {
      return solution.active[k] ? solution.forces[k] * matrix(k, k) < -tolerance : open[k] < -tolerance;
    };
    Eigen::Index count = 0, last = -1;
    for (Eigen::Index k = 0; k < size; ++k)
      if (wrong(k)) {
        ++count;
        last = k;
      }
    if (count == 0) {
      solution.converged = true;
      break;
    }
    ++solution.pivots;
    if (count < fewest) {
      fewest = count;
      patience = 8;
    } else if (patience > 0) {
      --patience;
    }
    if (patience > 0) {
      for (Eigen::Index k = 0; k < size; ++k)
        if (wrong(k))
          solution.active[k] = !solution.active[k];
    } else {
      solution.active[last] = !solution.active[last];
    }
  }
  solution.forces = solution.forces.cwiseMax(0);
  return solution;
}

} // namespace spherecut::solvers
