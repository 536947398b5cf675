// What a quasi-Newton iteration remembers: the last steps and how the forces changed along them (L-BFGS, Nocedal 1980).
#pragma once

#include "topology/base/types.hpp"

#include <deque>
#include <functional>

namespace spherecut::solvers {

class StepMemory {
 public:
  explicit StepMemory(int most) : most_(most) {}
  [[nodiscard]] bool empty() const { return pairs_.empty(); }
  void clear() { pairs_.clear(); }
  /// Keeps a step and the change of the forces along it, unless that says nothing of a positive stiffness.
  void add(const VectorX& step, const VectorX& change);
  /// The product of the inverse stiffness, as known, with the forces; `rest` applies that which is known from the
  /// start.
  [[nodiscard]] VectorX solve(const VectorX& forces, const std::function<VectorX(const VectorX&)>& rest) const;

 private:
  struct Pair {
    VectorX step, change;
    double product;
  };
  int most_;
  std::deque<Pair> pairs_;
};

} // namespace spherecut::solvers
