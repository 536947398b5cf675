// Reads the cutting part of a scenario file into its settings.
#pragma once

#include "src/scenario/cut_settings.hpp"
#include "src/scenario/document.hpp"

namespace spherecut::app {

/// A run of more steps is refused, or its time step derived coarser.
constexpr long most_steps = 1000000;

/// `number` of the precut for messages, from 1; `scenario`: the file, whose folder sheet files are relative to.
PrecutSettings precut(const Section& section, const std::filesystem::path& scenario, std::size_t number,
                      Offences& offences);

CutSettings cut(const Section& section);

BladeSettings blade(const Section& section, Offences& offences);

} // namespace spherecut::app
