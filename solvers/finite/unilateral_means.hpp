// Frictionless unilateral contact of means of the displacement at finite strain, by an augmented Lagrangian as that of
// a tool (solvers/finite/contact.hpp): direction . (at rest + mean) >= 0. Faces of a cut against each other
// (solvers/finite/lips.hpp) and tissue against the edge of a blade are of this kind.
#pragma once

#include "solvers/finite/active_constraints.hpp"

#include <array>

namespace spherecut::solvers {

struct UnilateralMean {
  DisplacementMean mean;               // or a difference of two
  Vector3 direction = Vector3::Zero(); // unit
  Vector3 at_rest = Vector3::Zero();   // m
  double stiffness = 0;                // N/m, of the penalty
  double spacing = 0;                  // m, between nodes there
  std::array<int, 2> carriers{};       // functions whose maps carry it from the body at rest
  [[nodiscard]] double gap(const VectorX& coefficients) const { return direction.dot(at_rest + mean.of(coefficients)); }
};

class UnilateralMeans {
 public:
  /// `first_key`: of the first mean, the others have those below it.
  explicit UnilateralMeans(int first_key) : first_key_(first_key) {}
  void add(UnilateralMean mean);

  [[nodiscard]] const std::vector<UnilateralMean>& means() const { return means_; }
  [[nodiscard]] UnilateralMean& mean(std::size_t index) { return means_[index]; }

  /// Adds the slope of the energy to `forces` and returns the energy, J. Remembers what touches.
  double add_forces(const VectorX& coefficients, VectorX& forces);
  /// Of every mean at the last call, N.
  [[nodiscard]] std::vector<double> forces() const;
  /// The forces at the last call become those that are known.
  void accept_forces() { known_ = forces(); }
  [[nodiscard]] const std::vector<double>& known_forces() const { return known_; }
  void set_known_forces(const std::vector<double>& forces) { known_ = forces; }

  /// At the last call of add_forces(): the largest overlap, or gap of a mean that bears a force, over the spacing
  /// there; how many touch; norm of the nodal forces.
  [[nodiscard]] double deepest() const { return deepest_; }
  [[nodiscard]] int touching() const { return static_cast<int>(active_.size()); }
  [[nodiscard]] double force_norm() const { return force_norm_; }
  /// Gap of each, m.
  [[nodiscard]] std::vector<double> gaps(const VectorX& coefficients) const;

  /// Adds those that touch, their directions carried back by `maps` (may be empty).
  void append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const;

 private:
  struct Active {
    int index;
    double force; // N
  };

  int first_key_;
  std::vector<UnilateralMean> means_;
  std::vector<double> known_; // N
  std::vector<Active> active_;
  double deepest_ = 0, force_norm_ = 0;
};

} // namespace spherecut::solvers
