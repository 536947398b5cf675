// A strip between clamps, cut along its middle, at finite strain.
#pragma once

#include "experiments/support/finite_block.hpp"
#include "topology/incision/cut_sheets.hpp"

namespace spherecut::tests {

inline constexpr double strip_half_length = 1.2, strip_depth = 0.2, strip_spacing = 0.1; // m

/// A strip 1 m high between clamps and sliding sides, cut along its middle up to x = tip. Its nodes lie in rows about
/// the cut, the same whatever the tip.
inline experiments::FiniteBlock cut_strip(double tip, double depth = strip_depth) {
  experiments::FiniteBlock block{.lower = {-strip_half_length, -0.55, 0},
                                 .upper = {strip_half_length, 0.55, depth},
                                 .spacing = strip_spacing,
                                 .jitter = 0};
  block.held[2].fill(true);
  block.held[3].fill(true);
  block.held[4][2] = block.held[5][2] = true;
  const double from = -strip_half_length - 0.3;
  block.cuts = {topology::make_rectangle_sheet({0.5 * (from + tip), 0, 0.5 * depth}, Vector3::UnitY(), Vector3::UnitX(),
                                               2 * depth, tip - from, 0.1)};
  return block;
}

/// The same with fine nodes about the tip.
inline experiments::FiniteBlock graded_strip(double tip, double depth) {
  experiments::FiniteBlock block = cut_strip(tip, depth);
  solvers::SpacingField field;
  field.fine = 0.07;
  field.coarse = 0.14;
  field.segments = {{Vector3(tip, 0, 0), Vector3(tip, 0, depth)}};
  block.graded = field;
  return block;
}

struct LoadedStrip {
  std::unique_ptr<solvers::FiniteBody> body;
  VectorX coefficients;
  double potential = 0; // J
};

/// Neo-Hookean, its clamps drawn apart by `stretch` and along it by `slide`.
inline LoadedStrip pulled_strip(const experiments::FiniteBlock& block, double nu, double stretch, double slide,
                                const solvers::Loads& loads = {}) {
  solvers::Problem problem = experiments::finite_block(block);
  problem.loads = loads;
  LoadedStrip strip;
  strip.body = std::make_unique<solvers::FiniteBody>(std::move(problem), experiments::neo_hookean(1, nu));
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = 1e-5;
  solvers::Equilibrium equilibrium(*strip.body, accurate);
  const int steps = stretch > 1.01 ? 4 : 1;
  solvers::EquilibriumStatus status;
  for (int k = 1; k <= steps; ++k) {
    const double part = static_cast<double>(k) / steps;
    status = equilibrium.solve({strip.body->prescribed_values([&](const Vector3& x) {
                                  return Vector3(part * slide * x.y(), part * (stretch - 1) * x.y(), 0);
                                }),
                                part,
                                {}});
  }
  strip.coefficients = equilibrium.coefficients();
  strip.potential = status.energy - strip.body->loads().dot(strip.coefficients);
  return strip;
}

} // namespace spherecut::tests
