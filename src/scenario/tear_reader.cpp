#include "src/scenario/tear_reader.hpp"

#include "src/scenario/scenario.hpp"
#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {

bool ToughnessLayer::holds(const Vector3& x) const {
  if (const auto* box = std::get_if<BoxLayer>(&shape))
    return (x.array() >= box->lower.array()).all() && (x.array() <= box->upper.array()).all();
  const auto& slab = std::get<SlabLayer>(shape);
  return std::abs(slab.normal.dot(x - slab.point)) <= 0.5 * slab.thickness;
}

std::function<double(const Vector3&)> toughness_field(const Scenario& scenario) {
  if (const auto& own = scenario.toughness_function)
    return [own](const Vector3& x) {
      const double toughness = own(x);
      if (!(toughness > 0) || !std::isfinite(toughness))
        throw InputError(fmt::format("toughness at ({:.6g}, {:.6g}, {:.6g}) m: {} J/m2; allowed: above 0, finite",
                                     x.x(), x.y(), x.z(), toughness));
      return toughness;
    };
  return [everywhere = scenario.toughness, layers = scenario.layers](const Vector3& x) {
    double toughness = everywhere;
    for (const ToughnessLayer& layer : layers)
      if (layer.holds(x))
        toughness = layer.toughness;
    return toughness;
  };
}

ToughnessLayer toughness_layer(const Section& section, std::size_t number, Offences& offences) {
  ToughnessLayer layer;
  layer.toughness = section.number("toughness");
  if (section.text("region") == "box") {
    const BoxLayer box{section.vector("lower"), section.vector("upper")};
    if ((box.lower.array() > box.upper.array()).any())
      offences.add(
          section.line("lower"),
          fmt::format("material.layer[{}].lower: above upper; allowed: lower <= upper in every coordinate", number));
    layer.shape = box;
  } else {
    layer.shape = SlabLayer{section.vector("point"),
                            direction(section, fmt::format("material.layer[{}].normal", number), "normal", offences),
                            section.number("thickness")};
  }
  return layer;
}

TearSettings tearing(const Section& section) {
  TearSettings tearing;
  tearing.enabled = section.boolean("enabled");
  tearing.step = section.number("step");
  tearing.direction = section.text("direction") == "hoop_stress" ? solvers::TearDirection::hoop_stress
                                                                 : solvers::TearDirection::weakest;
  tearing.strength = section.optional_number("strength").value_or(0);
  tearing.length = section.optional_number("length").value_or(0);
  tearing.most_increments = static_cast<int>(section.integer("most_increments"));
  tearing.most_area = section.optional_number("most_area").value_or(0);
  return tearing;
}

} // namespace spherecut::app
