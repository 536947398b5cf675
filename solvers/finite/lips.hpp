// Frictionless contact of the faces of a cut at finite strain: an augmented Lagrangian as that of a tool
// (solvers/finite/contact.hpp), from each lip node to its partner across the sheet. Their gap is that of the means over
// their shares along the normal of the deformed sheet, renewed until forces and gaps hold along the present one.
#pragma once

#include "solvers/contact/lip_contact.hpp"
#include "solvers/finite/active_constraints.hpp"

namespace spherecut::solvers {

class FiniteLips {
 public:
  /// `stiffness`: of a pair over E a / h, a the area of its share. Throws InputError for a pair of nodes that are not
  /// on the surface.
  FiniteLips(const FiniteBody& body, std::vector<LipPair> pairs, double stiffness = 20);

  [[nodiscard]] const std::vector<LipPair>& pairs() const { return pairs_; }
  /// Normals of the body in a state with these maps of its nodes (FiniteBody::piola_maps).
  void turn(const std::vector<Matrix3>& maps);

  /// Adds the slope of the energy to `forces` and returns the energy, J. Remembers what touches.
  double add(const VectorX& coefficients, VectorX& forces);
  /// Of every pair at the last call, N.
  [[nodiscard]] std::vector<double> forces() const;
  /// The forces at the last call become those that are known.
  void accept_forces() { known_ = forces(); }
  [[nodiscard]] std::vector<double> known_forces() const { return known_; }
  void set_known_forces(const std::vector<double>& forces) { known_ = forces; }

  /// At the last call of add(): the largest overlap, or gap of a pair that bears a force, over the spacing there; how
  /// many pairs touch; norm of the nodal forces.
  [[nodiscard]] double deepest() const { return deepest_; }
  [[nodiscard]] int touching() const { return static_cast<int>(active_.size()); }
  [[nodiscard]] double force_norm() const { return force_norm_; }
  /// Gap of every pair along its normal, m.
  [[nodiscard]] std::vector<double> openings(const VectorX& coefficients) const;

  /// Adds the pairs that touch, their normals carried back by `maps` (may be empty); their keys are below 0.
  void append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const;

 private:
  struct Active {
    int pair;
    double force; // N
  };
  [[nodiscard]] double opening(std::size_t pair, const VectorX& coefficients) const;

  const FiniteBody& body_;
  std::vector<LipPair> pairs_;
  std::vector<DisplacementMean> apart_; // mean of `plus` less that of `minus`
  std::vector<Vector3> normals_;
  std::vector<double> stiffness_; // N/m
  std::vector<double> known_;     // N
  std::vector<Active> active_;
  double deepest_ = 0, force_norm_ = 0;
};

} // namespace spherecut::solvers
