// The law of a scenario's material.
#pragma once

#include "solvers/elasticity/law.hpp"

#include <memory>
#include <variant>
#include <vector>

namespace spherecut::app {

/// Fibres that run alike everywhere.
struct StraightFibres {
  Vector3 direction; // unit
};
/// Fibres that run away from a line, or from a point where there is no axis.
struct RadialFibres {
  Vector3 centre;                 // m
  Vector3 axis = Vector3::Zero(); // unit, of the line
};
using FibreFamily = std::variant<StraightFibres, RadialFibres>;

struct LawSettings {
  solvers::LawSpec spec;
  std::vector<FibreFamily> fibres; // of the families
  int line = 0;                    // of the scenario file
  /// A program's own, in place of spec and fibres; null: theirs.
  std::shared_ptr<const solvers::Law> own;
  /// Directions at a place of the given shape; zero, no fibre, on the line or the point that radial ones run away from.
  [[nodiscard]] solvers::FibreFrame fibres_at(const Vector3& x) const;
};

} // namespace spherecut::app
