// Reads the tearing part of a scenario file into its settings.
#pragma once

#include "src/scenario/document.hpp"
#include "src/scenario/tear_settings.hpp"

namespace spherecut::app {

/// `number` of the layer for messages, from 1.
ToughnessLayer toughness_layer(const Section& section, std::size_t number, Offences& offences);

TearSettings tearing(const Section& section);

} // namespace spherecut::app
