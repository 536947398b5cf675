// Frictionless contact of the faces of a cut at finite strain, from each lip node to its partner across the sheet.
// Their gap is that of the means over their shares along the normal of the deformed sheet, renewed until forces and
// gaps hold along the present one.
#pragma once

#include "solvers/contact/lip_contact.hpp"
#include "solvers/finite/unilateral_means.hpp"

namespace spherecut::solvers {

class FiniteLips {
 public:
  /// `stiffness`: of a pair over E a / h, a the area of its share. Throws InputError for a pair of nodes that are not
  /// on the surface.
  FiniteLips(const FiniteBody& body, std::vector<LipPair> pairs, double stiffness = 20);

  [[nodiscard]] const std::vector<LipPair>& pairs() const { return pairs_; }
  /// Their gaps, one a pair; keys are below 0.
  [[nodiscard]] const UnilateralMeans& contact() const { return contact_; }
  [[nodiscard]] UnilateralMeans& contact() { return contact_; }
  /// Normals of the body in a state with these maps (FiniteBody::piola_maps).
  void turn(const std::vector<Matrix3>& maps);

 private:
  std::vector<LipPair> pairs_;
  UnilateralMeans contact_{-1};
};

} // namespace spherecut::solvers
