#include "solvers/finite/step_memory.hpp"

namespace spherecut::solvers {

void StepMemory::add(const VectorX& step, const VectorX& change) {
  const double product = step.dot(change);
  if (!(product > 1e-12 * step.norm() * change.norm()))
    return;
  if (static_cast<int>(pairs_.size()) == most_)
    pairs_.pop_front();
  if (most_ > 0)
    pairs_.push_back({step, change, product});
}

VectorX StepMemory::solve(const VectorX& forces, const std::function<VectorX(const VectorX&)>& rest) const {
  VectorX q = forces;
  std::vector<double> along(pairs_.size());
  for (std::size_t k = pairs_.size(); k-- > 0;) {
    along[k] = pairs_[k].step.dot(q) / pairs_[k].product;
    q -= along[k] * pairs_[k].change;
  }
  VectorX result = rest(q);
  for (std::size_t k = 0; k < pairs_.size(); ++k)
    result += (along[k] - pairs_[k].change.dot(result) / pairs_[k].product) * pairs_[k].step;
  return result;
}

} // namespace spherecut::solvers
