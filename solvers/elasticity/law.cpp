#include "solvers/elasticity/law.hpp"

#include "solvers/elasticity/law_of.hpp"
#include "solvers/elasticity/neo_hookean.hpp"

#include <fmt/format.h>

namespace spherecut::solvers {
namespace {

void check_positive(const char* law, const char* what, double value) {
  if (!(value > 0) || !std::isfinite(value))
    throw InputError(fmt::format("law {}: {} is {} Pa; it must be positive and finite", law, what, value));
}

} // namespace

void check_lengths(const char* law, std::size_t gradients, std::size_t frames, std::size_t energies,
                   std::size_t stresses) {
  if (energies != gradients || stresses != gradients || !(frames == 0 || frames == gradients))
    throw InputError(fmt::format("law {}: {} gradients, {} fibre frames, {} energies, {} stresses; lengths must agree",
                                 law, gradients, frames, energies, stresses));
}

std::unique_ptr<Law> make_law(const LawSpec& spec) {
  if (const auto* neo_hookean = std::get_if<NeoHookeanLaw>(&spec.law)) {
    check_positive(NeoHookeanModel::name, "the shear modulus", neo_hookean->shear_modulus);
    check_positive(NeoHookeanModel::name, "the bulk modulus", spec.bulk_modulus);
    return std::make_unique<LawOf<NeoHookeanModel>>(NeoHookeanModel{*neo_hookean}, spec.bulk_modulus, FibreFrame{});
  }
  throw InputError("law: only neo_hookean is built so far");
}

} // namespace spherecut::solvers
