// Exact states of hyperelastic solids at finite strain, for any isotropic law.
#pragma once

#include "solvers/elasticity/law.hpp"

#include <vector>

namespace spherecut::experiments {

/// A block stretched along its edges.
struct BlockState {
  Vector3 stretch = Vector3::Ones();
  Vector3 stress = Vector3::Zero(); // Pa, first Piola stress along the edges
};

/// Stretches given where `held`; the others make their stress vanish. Throws NumericalError where none does.
BlockState block_state(const solvers::Law& law, const Vector3& stretch, const std::array<bool, 3>& held);

/// A block |X| <= half, bent in plane strain such that planes Y = const stay plane and turn by `curvature` Y about an
/// axis: (X, Y) goes to r(X) (cos, sin)(curvature Y) [Rivlin 1949; of a compressible law too: the radial equilibrium
/// dP_rr/dX = curvature P_tt with P_rr = 0 on both faces is one ordinary differential equation].
class BentBlock {
 public:
  BentBlock(const solvers::Law& law, double half, double curvature);
  [[nodiscard]] double radius(double x) const; // r(X), m
  /// Displacement that leaves the axis of bending at X = -1 / curvature, m.
  [[nodiscard]] Vector3 displacement(const Vector3& x) const;
  [[nodiscard]] double moment() const { return moment_; } // N, about the axis, per depth
  [[nodiscard]] double inner_stretch() const { return curvature_ * radii_.front(); }
  [[nodiscard]] double outer_stretch() const { return curvature_ * radii_.back(); }

 private:
  double half_, curvature_, moment_ = 0;
  std::vector<double> radii_; // at equal steps of X
  std::vector<double> slopes_;
};

} // namespace spherecut::experiments
