// The organ of a scenario as a solid.
#pragma once

#include "src/scenario/scenario.hpp"
#include "topology/domain/domain.hpp"

namespace spherecut::app {

struct Organ {
  std::shared_ptr<const topology::Domain> domain;
  std::vector<std::string> remarks; // what was mended, sizes that look like a wrong unit
};

/// Makes a built-in organ, or reads and checks a surface file or a label volume. Throws InputError naming the file and
/// its defect.
Organ make_organ(const OrganSettings& settings);

/// The surface of an organ from a file, as it is mended. Throws as make_organ.
topology::CheckedSurface read_organ_surface(const FileOrgan& organ);

/// Writes the surface of an organ (surface_io.hpp) in the unit of its file, metres for a built-in organ and a label
/// volume. Throws as make_organ, and InputError when the file is there already or cannot be written.
void write_organ_surface(const OrganSettings& settings, const std::filesystem::path& file);

} // namespace spherecut::app
