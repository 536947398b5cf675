// How wrong a wall bends that has few nodes through it.
#pragma once

#include "solvers/body/discretisation.hpp"

#include <string>

namespace spherecut::app {

/// By how much a wall with so many spacings through it bends too little or too much by a method, in words.
std::string bending_error(double spacings_through, solvers::Method method);

} // namespace spherecut::app
