// The organ of a scenario as a solid.
#pragma once

#include "src/scenario.hpp"
#include "topology/domain.hpp"

namespace spherecut::app {

struct Organ {
  std::shared_ptr<const topology::Domain> domain;
  std::vector<std::string> remarks; // what was mended, sizes that look like a wrong unit
};

/// Makes a built-in organ, or reads and checks a surface file. Throws InputError naming the file and its defect.
Organ make_organ(const OrganSettings& settings);

} // namespace spherecut::app
