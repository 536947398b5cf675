// The parts of a scenario's organ that have a material of their own.
#pragma once

#include "src/scenario/document.hpp"
#include "src/scenario/scenario.hpp"

#include <memory>
#include <string>
#include <vector>

namespace spherecut::app {

/// [[material.region]]; `elsewhere` has the density of those that give none. Offences name file, line, key and value.
std::vector<RegionSettings> material_regions(const Section& material, const std::filesystem::path& scenario,
                                             const solvers::Material& elsewhere, Offences& offences);

/// What regions do not go with: methods but galerkin, laws of finite strain, cuts.
void check_regions(const Scenario& scenario, Offences& offences);

/// The regions within an organ; null without any. Throws InputError as solvers::MaterialRegions does.
std::shared_ptr<const solvers::MaterialRegions> regions_of(const Scenario& scenario,
                                                           const std::shared_ptr<const topology::Domain>& organ);

/// Throws InputError where two regions hold a place of a lattice in the organ, a fiftieth of its size wide: before
/// nodes are made. What overlaps by less the quadrature points tell when a body is made.
void require_regions_apart(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& organ);

/// A line for each of them; empty without any.
std::string regions_text(const std::vector<RegionSettings>& regions);

} // namespace spherecut::app
