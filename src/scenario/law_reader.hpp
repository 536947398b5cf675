// Reads the law of a scenario's material, tells it, and knows which bodies it needs.
#pragma once

#include "src/scenario/document.hpp"
#include "src/scenario/law_settings.hpp"

#include <filesystem>

namespace spherecut::app {

LawSettings material_law(const Section& material, Offences& offences);

/// The program's own, or the one that the file says; its name; its moduli at rest, Pa. The first throws InputError as
/// solvers::check_law.
std::shared_ptr<const solvers::Law> law_of(const LawSettings& law);
std::string name_of(const LawSettings& law);
solvers::ElasticConstants moduli_of(const LawSettings& law);

/// Name, moduli at small strain, of a viscoelastic law those after a long time too, and what fibres add; several lines.
std::string law_text(const LawSettings& law);

/// Whether bodies of it are computed at finite strain.
bool is_nonlinear(const LawSettings& law);
/// Throws InputError naming file, line, law and what is possible, unless it is the linear law without Prony series.
void require_linear(const std::filesystem::path& file, const LawSettings& law);

} // namespace spherecut::app
