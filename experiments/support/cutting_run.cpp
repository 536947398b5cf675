#include "experiments/support/cutting_run.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

using solvers::BladeState;

class Cutting {
 public:
  Cutting(const CuttingCase& block, std::span<const CuttingBody> bodies, const Knife& knife)
      : block_(block), knife_(knife), bodies_(bodies),
        state_(push_blade(bodies[0].patch, bodies[0].advance(bodies[0].depth))), blade_(bodies[0].depth) {}

  CuttingRun through(std::size_t first, double steady_from) {
    Sums steady, pending;
    for (std::size_t now = 0, next = first; next < bodies_.size();) {
      const CuttingBody &body = bodies_[now], &cut = bodies_[next];
      if (blade_ > body.depth + knife_.reach)
        throw NumericalError(fmt::format("the blade has gone {:.4g} m and cut {:.4g} m", blade_, body.depth));
      const double drag = block_.shear > 0 && body.depth > 0 ? 1 : 0;
      const double needed = knife_.toughness / knife_.sharpness * (cut.depth - body.depth) * block_.front();
      const double target = blade_ + knife_.stroke;
      const auto share = solvers::cutting_share(body.patch, body.stroke(blade_, target), cut.patch,
                                                cut.stroke(blade_, target), needed, drag);
      const double reached = blade_ + knife_.stroke * share.value_or(1);
      advance(body, reached, drag, pending);
      if (!share)
        continue;
      take(body, cut);
      if (body.depth >= steady_from - 1e-9 * cut.depth) // whole pieces, from one cut to the next
        steady.add(pending);
      pending = {};
      now = next++;
    }
    run_.steady = steady.work / steady.way;
    run_.steady_along = steady.along / steady.way;
    run_.lag = steady.lag / steady.way;
    return run_;
  }

 private:
  struct Sums { // over the way of the blade
    double work = 0, along = 0, lag = 0, way = 0;
    void add(const Sums& other) {
      work += other.work;
      along += other.along;
      lag += other.lag;
      way += other.way;
    }
  };

  /// Moves the blade in short parts, so that the forces change evenly over each.
  void advance(const CuttingBody& body, double reached, double drag, Sums& sums) {
    constexpr int parts = 20;
    const double from = blade_, way = reached - from;
    const BladeState before = state_;
    for (int k = 1; k <= parts; ++k) {
      const double at = from + way * k / parts;
      const BladeState next = push_blade(body.patch, body.advance(at), drag);
      run_.ledger.move(body.patch, state_, next, next.advance - state_.advance, way * block_.way() / parts);
      state_ = next;
    }
    const Vector3 mean = -0.5 * (before.blade_force + state_.blade_force);
    sums.add({mean.x() * way, mean.dot(block_.along()) * way, (0.5 * (from + reached) - body.depth) * way, way});
    blade_ = reached;
    note();
  }

  void take(const CuttingBody& body, const CuttingBody& cut) {
    if (body.depth == 0) {
      run_.rupture_force = -state_.blade_force.x();
      run_.rupture_blade = blade_;
    }
    const double area = (cut.depth - body.depth) * block_.front();
    const BladeState after = push_blade(cut.patch, cut.advance(blade_), block_.shear > 0 ? 1 : 0);
    run_.ledger.cut(state_, after, knife_.toughness, knife_.sharpness, area);
    state_ = after;
    if (body.depth == 0)
      run_.after_rupture = -state_.blade_force.x();
    note();
  }

  void note() {
    run_.blade.push_back(blade_);
    run_.force.push_back(-state_.blade_force.x());
  }

  const CuttingCase& block_;
  const Knife& knife_;
  std::span<const CuttingBody> bodies_;
  BladeState state_;
  double blade_;
  CuttingRun run_;
};

} // namespace

Rupture first_rupture(const CuttingCase& block, const CuttingBody& uncut, std::span<const CuttingBody> cuts,
                      const Knife& knife) {
  Rupture first;
  first.blade = std::numeric_limits<double>::infinity();
  const double needed_per_depth = knife.toughness / knife.sharpness * block.front();
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    const CuttingBody& cut = cuts[k];
    for (double blade = 0; blade < std::min(knife.reach, first.blade); blade += knife.stroke)
      if (const auto share =
              solvers::cutting_share(uncut.patch, uncut.stroke(blade, blade + knife.stroke), cut.patch,
                                     cut.stroke(blade, blade + knife.stroke), needed_per_depth * cut.depth)) {
        if (const double at = blade + *share * knife.stroke; at < first.blade)
          first = {k, cut.depth, at, -push_blade(uncut.patch, uncut.advance(at)).edge_force.x()};
        break;
      }
  }
  if (first.length == 0)
    throw NumericalError(fmt::format("the blade does not cut within {} m", knife.reach));
  return first;
}

CuttingRun run_blade(const CuttingCase& block, std::span<const CuttingBody> bodies, const Knife& knife,
                     double steady_from, std::size_t first) {
  return Cutting(block, bodies, knife).through(first, steady_from);
}

} // namespace spherecut::experiments
