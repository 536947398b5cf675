// What bodies are given from Python: surface that is held, loads, laws that are functions.
#pragma once

#include "python/bindings/shared.hpp"

namespace spherecut::bindings {

/// Surface that is held.
struct Held {
  std::shared_ptr<app::FixedRegion> region; // or a function
  std::optional<Kept> function;
  std::array<bool, 3> components{true, true, true};
  Vector3 value = Vector3::Zero(); // m, where there is no field
  VectorFunction field;
  [[nodiscard]] bool holds(const Vector3& x, const Vector3& normal) const;
  [[nodiscard]] Vector3 at(const Vector3& x) const { return field ? field(x) : value; }
};

/// Holds the surface nodes of the problem. Throws InputError where one holds none. Not with the interpreter's lock.
void hold(const std::vector<Held>& all, solvers::Problem& problem);

/// N/m3 and Pa: a constant of three numbers, a function or None each. Throws InputError.
solvers::Loads loads_from(const py::object& body_force, const py::object& traction, const py::object& lip_traction);

/// Whether this thread is in a function of a law now.
bool in_law_function();

} // namespace spherecut::bindings
