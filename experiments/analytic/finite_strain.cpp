#include "experiments/analytic/finite_strain.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr int bending_steps = 400;

Vector3 stress_of(const solvers::Law& law, const Vector3& stretch) {
  const Matrix3 gradient = stretch.asDiagonal();
  Matrix3 stress;
  double energy = 0;
  law.evaluate({&gradient, 1}, {}, {&energy, 1}, {&stress, 1});
  return stress.diagonal();
}

/// A sign change of a rising function on a bracket.
template <class F>
double root(F&& f, double low, double high) {
  if (!(f(low) <= 0 && f(high) >= 0))
    throw NumericalError(fmt::format("no root between {:.6g} and {:.6g}", low, high));
  for (int k = 0; k < 200 && high - low > 1e-15 * high; ++k) {
    const double middle = 0.5 * (low + high);
    (f(middle) < 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

} // namespace

BlockState block_state(const solvers::Law& law, const Vector3& stretch, const std::array<bool, 3>& held) {
  BlockState state{stretch, Vector3::Zero()};
  std::vector<int> free;
  for (int axis = 0; axis < 3; ++axis)
    if (!held[axis])
      free.push_back(axis);
  // The free edges of an isotropic law stretch alike.
  if (!free.empty()) {
    const double l = root(
        [&](double trial) {
          Vector3 all = stretch;
          for (const int axis : free)
            all[axis] = trial;
          return stress_of(law, all)[free.front()];
        },
        0.05, 5);
    for (const int axis : free)
      state.stretch[axis] = l;
  }
  state.stress = stress_of(law, state.stretch);
  return state;
}

BentBlock::BentBlock(const solvers::Law& law, double half, double curvature) : half_(half), curvature_(curvature) {
  const double step = 2 * half / bending_steps;
  struct Pair {
    double radius, stress;
  };
  // dr/dX with the radial stress given.
  const auto slope = [&](const Pair& at) {
    const double around = curvature * at.radius;
    double s = 1 / around;
    for (int k = 0; k < 60; ++k) {
      constexpr double small = 1e-6;
      const double value = stress_of(law, {s, around, 1}).x() - at.stress;
      const double rate =
          (stress_of(law, {s * (1 + small), around, 1}).x() - stress_of(law, {s * (1 - small), around, 1}).x()) /
          (2 * small * s);
      const double change = std::clamp(value / rate, -0.3 * s, 0.3 * s);
      s -= change;
      if (std::abs(change) < 1e-13 * s)
        break;
    }
    return s;
  };
  const auto rates = [&](const Pair& at) {
    const double s = slope(at);
    return Pair{s, curvature * stress_of(law, {s, curvature * at.radius, 1}).y()};
  };
  // Radial stress at the outer face when the inner one, free, has the given radius.
  const auto shoot = [&](double inner) {
    Pair at{inner, 0};
    radii_.assign(1, inner);
    slopes_.assign(1, slope(at));
    for (int k = 0; k < bending_steps; ++k) {
      const Pair a = rates(at), b = rates({at.radius + 0.5 * step * a.radius, at.stress + 0.5 * step * a.stress}),
                 c = rates({at.radius + 0.5 * step * b.radius, at.stress + 0.5 * step * b.stress}),
                 d = rates({at.radius + step * c.radius, at.stress + step * c.stress});
      at.radius += step / 6 * (a.radius + 2 * b.radius + 2 * c.radius + d.radius);
      at.stress += step / 6 * (a.stress + 2 * b.stress + 2 * c.stress + d.stress);
      radii_.push_back(at.radius);
      slopes_.push_back(slope(at));
    }
    return at.stress;
  };
  // About the incompressible solution, r_inner r_outer = 1 / curvature^2.
  const double d = 4 * half / curvature, p = std::pow(curvature, -2);
  const double guess = std::sqrt(0.5 * (-d + std::sqrt(d * d + 4 * p * p)));
  double low = 0.97 * guess, high = 1.03 * guess;
  double at_low = shoot(low);
  if (at_low * shoot(high) > 0)
    throw NumericalError(fmt::format("no bent state about the inner radius {:.6g} m", guess));
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high), value = shoot(middle);
    if ((value < 0) == (at_low < 0)) {
      low = middle;
      at_low = value;
    } else {
      high = middle;
    }
  }
  shoot(0.5 * (low + high));
  for (int k = 0; k <= bending_steps; ++k) { // Simpson's rule
    const double weight = (k == 0 || k == bending_steps ? 1 : k % 2 == 1 ? 4 : 2) * step / 3;
    moment_ += weight * radii_[k] * stress_of(law, {slopes_[k], curvature * radii_[k], 1}).y();
  }
}

double BentBlock::radius(double x) const {
  const double step = 2 * half_ / bending_steps;
  const int k = std::clamp(static_cast<int>((x + half_) / step), 0, bending_steps - 1);
  const double t = (x + half_) / step - k;
  return radii_[k] * (1 + 2 * t) * (1 - t) * (1 - t) + slopes_[k] * step * t * (1 - t) * (1 - t) +
         radii_[k + 1] * t * t * (3 - 2 * t) + slopes_[k + 1] * step * t * t * (t - 1);
}

Vector3 BentBlock::displacement(const Vector3& x) const {
  const double r = radius(x.x()), angle = curvature_ * x.y();
  return {r * std::cos(angle) - 1 / curvature_ - x.x(), r * std::sin(angle) - x.y(), 0};
}

} // namespace spherecut::experiments
