// The tearing part of a scenario: where the tissue is weaker, when and how its cuts run on by themselves.
#pragma once

#include "solvers/fracture/tearing.hpp"

#include <functional>
#include <variant>
#include <vector>

namespace spherecut::app {

struct BoxLayer {
  Vector3 lower, upper; // m
};
struct SlabLayer {
  Vector3 point, normal; // m, on its middle plane; unit
  double thickness = 0;  // m
};

/// A part of the tissue with a toughness of its own.
struct ToughnessLayer {
  std::variant<BoxLayer, SlabLayer> shape;
  double toughness = 0;                             // J/m2
  [[nodiscard]] bool holds(const Vector3& x) const; // bounds included
};

struct TearSettings {
  bool enabled = false;
  double step = 0.5; // longest way of the front in an increment, in fine spacings
  solvers::TearDirection direction = solvers::TearDirection::weakest;
  double strength = 0;      // Pa, largest principal stress that starts a tear; 0: none starts without a cut
  double length = 0;        // m over which that stress is averaged, 0: derived
  int most_increments = 40; // in one step of the run
  double most_area = 0;     // m2 torn, beyond which a run tears no more; 0: no limit
};

} // namespace spherecut::app
