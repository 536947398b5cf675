// Reads the law of a scenario's material, tells it, and knows which laws a run computes.
#pragma once

#include "src/law_settings.hpp"
#include "src/scenario_document.hpp"

#include <filesystem>

namespace spherecut::app {

LawSettings material_law(const Section& material, Offences& offences);

/// Name, moduli at small strain, of a viscoelastic law those after a long time too, and what fibres add; several lines.
std::string law_text(const LawSettings& law);

/// Whether bodies can be computed: the linear law without Prony series.
bool is_computed(const LawSettings& law);
/// Throws InputError naming file, line, law and what is possible, when they cannot.
void require_computed(const std::filesystem::path& file, const LawSettings& law);

} // namespace spherecut::app
