#include "src/scenario/law_reader.hpp"

#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::app {
namespace {

double shear_modulus(const Section& material) {
  return material.number("young_modulus") / (2 * (1 + material.number("poisson_ratio")));
}

solvers::YeohLaw yeoh(const Section& material) {
  return {material.number("c1"), material.number("c2"), material.number("c3")};
}

solvers::OgdenLaw ogden(const Section& material) {
  solvers::OgdenLaw law;
  for (const Section& term : material.tables("ogden"))
    law.terms.push_back({term.number("modulus"), term.number("exponent")});
  return law;
}

solvers::HolzapfelLaw holzapfel(const Section& material, LawSettings& settings, Offences& offences) {
  solvers::HolzapfelLaw law;
  law.shear_modulus = shear_modulus(material);
  law.fibre_modulus = material.number("fibre_modulus");
  law.fibre_exponent = material.number("fibre_exponent");
  law.dispersion = material.number("fibre_dispersion");
  for (const Section& fibre : material.tables("fibre")) {
    const std::string name = fmt::format("material.fibre[{}]", settings.fibres.size() + 1);
    if (fibre.text("course") == "radial") {
      RadialFibres radial{fibre.vector("centre")};
      if (fibre.has("axis"))
        radial.axis = direction(fibre, name + ".axis", "axis", offences);
      settings.fibres.emplace_back(radial);
      law.same_everywhere = false;
    } else {
      settings.fibres.emplace_back(StraightFibres{direction(fibre, name + ".direction", "direction", offences)});
    }
  }
  law.families = static_cast<int>(settings.fibres.size());
  if (law.same_everywhere)
    for (const FibreFamily& family : settings.fibres)
      law.directions.push_back(std::get<StraightFibres>(family).direction);
  return law;
}

/// A direction of zero has been told.
bool has_directions(const solvers::LawSpec& spec) {
  if (const auto* law = std::get_if<solvers::HolzapfelLaw>(&spec.law))
    for (const Vector3& a : law->directions)
      if (a.isZero(0))
        return false;
  return true;
}

} // namespace

solvers::FibreFrame LawSettings::fibres_at(const Vector3& x) const {
  solvers::FibreFrame frame;
  for (std::size_t family = 0; family < fibres.size() && family < frame.direction.size(); ++family) {
    if (const auto* straight = std::get_if<StraightFibres>(&fibres[family])) {
      frame.direction[family] = straight->direction;
      continue;
    }
    const auto& radial = std::get<RadialFibres>(fibres[family]);
    const Vector3 away = x - radial.centre;
    const Vector3 across = away - radial.axis.dot(away) * radial.axis;
    if (across.norm() > 1e-9)
      frame.direction[family] = across.normalized();
  }
  return frame;
}

LawSettings material_law(const Section& material, Offences& offences) {
  LawSettings settings;
  settings.line = static_cast<int>(material.line("law"));
  solvers::LawSpec& spec = settings.spec;
  const std::string name = material.text("law");
  if (name == "neo_hookean")
    spec.law = solvers::NeoHookeanLaw{shear_modulus(material)};
  else if (name == "yeoh")
    spec.law = yeoh(material);
  else if (name == "ogden")
    spec.law = ogden(material);
  else if (name == "holzapfel_gasser_ogden")
    spec.law = holzapfel(material, settings, offences);
  else if (name == "linear")
    spec.law = solvers::LinearLaw{shear_modulus(material)};
  else
    throw InputError(fmt::format("material.law = \"{}\": the program has no such law", name));
  spec.bulk_modulus =
      solvers::bulk_modulus_of(solvers::small_strain_moduli(spec).shear_modulus, material.number("poisson_ratio"));
  for (const Section& term : material.tables("prony"))
    spec.prony.push_back({term.number("share"), term.number("time")});
  if (has_directions(spec))
    try {
      solvers::check_law(spec);
    } catch (const InputError& error) {
      offences.add(settings.line, fmt::format("material: {}", error.what()));
    }
  return settings;
}

std::shared_ptr<const solvers::Law> law_of(const LawSettings& law) {
  return law.own ? law.own : solvers::make_law(law.spec);
}

std::string name_of(const LawSettings& law) {
  return law.own ? law.own->name() : solvers::law_name(law.spec);
}

solvers::ElasticConstants moduli_of(const LawSettings& law) {
  return law.own ? law.own->small_strain() : solvers::small_strain_moduli(law.spec);
}

std::string law_text(const LawSettings& law) {
  const solvers::ElasticConstants moduli = moduli_of(law);
  std::string text = fmt::format("material: law {}, at small strain E = {:.4g} Pa, nu = {:.4g} (shear modulus {:.4g} "
                                 "Pa, bulk modulus {:.4g} Pa)",
                                 name_of(law), moduli.young_modulus(), moduli.poisson_ratio(), moduli.shear_modulus,
                                 moduli.bulk_modulus);
  if (law.own)
    return text;
  if (const auto* fibres = std::get_if<solvers::HolzapfelLaw>(&law.spec.law))
    text += fmt::format("\n  {} famil{} of fibres, which add in tension alone: {:.4g} Pa along them at small strain",
                        fibres->families, fibres->families == 1 ? "y" : "ies", solvers::fibre_stiffness(*fibres));
  if (!law.spec.prony.empty()) {
    solvers::ElasticConstants lasting = moduli;
    for (const solvers::PronyTerm& term : law.spec.prony)
      lasting.shear_modulus -= term.share * moduli.shear_modulus;
    text += fmt::format("\n  these hold of a sudden strain; after a long time E = {:.4g} Pa, nu = {:.4g}",
                        lasting.young_modulus(), lasting.poisson_ratio());
  }
  return text;
}

bool is_nonlinear(const LawSettings& law) {
  return law.own || !std::holds_alternative<solvers::LinearLaw>(law.spec.law);
}

void require_linear(const std::filesystem::path& file, const LawSettings& law) {
  if (is_nonlinear(law))
    throw InputError(fmt::format("{}:{}: material.law = \"{}\": this body is of small strain; possible for it: "
                                 "material.law = \"linear\" without material.prony",
                                 file.string(), law.line, name_of(law)));
  if (!law.spec.prony.empty())
    throw InputError(
        fmt::format("{}:{}: material.prony does not go with material.law = \"linear\"; possible: a law of finite "
                    "strain off line, or a material without it",
                    file.string(), law.line));
}

} // namespace spherecut::app
