// The law of a scenario's material.
#pragma once

#include "solvers/elasticity/law.hpp"

namespace spherecut::app {

struct LawSettings {
  solvers::LawSpec spec;
  int line = 0; // of the scenario file
};

} // namespace spherecut::app
