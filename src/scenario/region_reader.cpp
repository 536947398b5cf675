#include "src/scenario/region_reader.hpp"

#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/files/label_volume.hpp"
#include "topology/organ/surface_check.hpp"

#include <fmt/format.h>

namespace spherecut::app {
namespace {

/// Where a region's key stands, for messages.
struct RegionPlace {
  const Section& section;
  std::size_t number;
  Offences& offences;
  void refuse(const char* key, const std::string& what) const {
    offences.add(section.line(key), fmt::format("material.region[{}].{}", number, what));
  }
};

BoxRegion region_box(const RegionPlace& at) {
  BoxRegion box{at.section.vector("lower"), at.section.vector("upper")};
  for (int axis = 0; axis < 3; ++axis)
    if (!(box.lower[axis] < box.upper[axis])) {
      at.refuse("lower", fmt::format("lower: {} = {:g} m is not below that of upper, {:g} m; allowed: lower < upper in "
                                     "every coordinate",
                                     "xyz"[axis], box.lower[axis], box.upper[axis]));
      break;
    }
  return box;
}

SolidRegion region_solid(const RegionPlace& at, const std::filesystem::path& scenario) {
  const std::filesystem::path file = scenario.parent_path() / at.section.text("file");
  const double scale = at.section.optional_number("scale").value_or(0);
  const auto label = at.section.optional_integer("label");
  try {
    if (topology::is_label_volume(file)) {
      const topology::LabelSurface made =
          topology::label_surface(topology::read_label_volume(file, scale),
                                  label ? std::optional<int>(static_cast<int>(*label)) : std::nullopt, file.string());
      return {topology::make_organ_domain(topology::check_surface(made.soup, file.string()).mesh)};
    }
    if (label)
      at.refuse("label", fmt::format("label = {}: {} is a surface, which has no labels; allowed: with a label volume "
                                     "(.nrrd, .nii, .nii.gz, .mha)",
                                     *label, at.section.text("file")));
    return {topology::make_organ_domain(topology::read_surface(file, scale > 0 ? scale : 1).mesh)};
  } catch (const InputError& error) {
    at.refuse("file", fmt::format("file = \"{}\": {}", at.section.text("file"), error.what()));
    return {};
  }
}

RegionSettings::Shape region_shape(const RegionPlace& at, const std::filesystem::path& scenario) {
  const Section& section = at.section;
  const std::string shape = section.text("shape");
  if (shape == "box")
    return region_box(at);
  if (shape == "sphere")
    return SphereRegion{section.vector("centre"), section.number("radius")};
  if (shape == "file")
    return region_solid(at, scenario);
  if (shape == "depth") {
    const DepthRegion depth{section.number("from"), section.number("to")};
    if (!(depth.from < depth.to))
      at.refuse("to", fmt::format("to = {:g} m: not below from = {:g} m; allowed: above it", depth.to, depth.from));
    return depth;
  }
  const Vector3 normal =
      direction(section, fmt::format("material.region[{}].normal", at.number), "normal", at.offences);
  const Plane plane{normal, normal.dot(section.vector("point"))};
  if (shape == "half_space")
    return plane;
  return SlabRegion{plane, section.number("thickness")};
}

struct FacesOf {
  const std::shared_ptr<const topology::Domain>& organ;
  using Faces = std::vector<solvers::RegionFace>;
  Faces operator()(const BoxRegion& box) const { return solvers::box_faces(box.lower, box.upper); }
  Faces operator()(const SphereRegion& ball) const { return solvers::ball_faces(ball.centre, ball.radius); }
  Faces operator()(const Plane& plane) const { return solvers::half_space_faces(plane); }
  Faces operator()(const SlabRegion& slab) const {
    return solvers::slab_faces({slab.middle.normal, slab.middle.offset + 0.5 * slab.thickness}, slab.thickness);
  }
  Faces operator()(const DepthRegion& depth) const { return solvers::depth_faces(organ, depth.from, depth.to); }
  Faces operator()(const SolidRegion& solid) const { return solvers::solid_faces(solid.solid); }
};

} // namespace

std::vector<RegionSettings> material_regions(const Section& material, const std::filesystem::path& scenario,
                                             const solvers::Material& elsewhere, Offences& offences) {
  std::vector<RegionSettings> regions;
  for (const Section& section : material.tables("region")) {
    const RegionPlace at{section, regions.size() + 1, offences};
    RegionSettings region;
    region.line = static_cast<int>(section.line());
    region.name = section.text("name");
    if (region.name.empty())
      region.name = fmt::format("{}", at.number);
    region.material = {section.number("young_modulus"), section.number("poisson_ratio"),
                       section.optional_number("density").value_or(elsewhere.density)};
    region.shape = region_shape(at, scenario);
    regions.push_back(std::move(region));
  }
  return regions;
}

void check_regions(const Scenario& scenario, Offences& offences) {
  if (scenario.regions.empty())
    return;
  const auto refuse = [&](const std::string& what) {
    offences.add(scenario.regions.front().line,
                 fmt::format("material.region with {}; allowed: with method.name = \"galerkin\" and material.law = "
                             "\"linear\", without blade, precuts and tearing",
                             what));
  };
  if (scenario.method.method != solvers::Method::galerkin)
    refuse(fmt::format("method.name = \"{}\"", solvers::to_string(scenario.method.method)));
  if (is_nonlinear(scenario.law))
    refuse(fmt::format("material.law = \"{}\"", name_of(scenario.law)));
  if (scenario.blade)
    refuse("a blade");
  if (!scenario.precuts.empty())
    refuse("precuts");
  if (scenario.tearing.enabled)
    refuse("tearing");
}

std::shared_ptr<const solvers::MaterialRegions> regions_of(const Scenario& scenario,
                                                           const std::shared_ptr<const topology::Domain>& organ) {
  if (scenario.regions.empty())
    return nullptr;
  std::vector<solvers::MaterialRegion> regions;
  for (const RegionSettings& region : scenario.regions)
    regions.push_back({region.name, std::visit(FacesOf{organ}, region.shape), region.material});
  return std::make_shared<const solvers::MaterialRegions>(std::move(regions));
}

void require_regions_apart(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& organ) {
  constexpr int across = 50; // places along the longest side
  const auto regions = regions_of(scenario, organ);
  if (regions == nullptr)
    return;
  const Vector3 lower = organ->bounds().lower, extent = organ->bounds().extent();
  const double step = extent.maxCoeff() / across;
  const auto places = [&](int axis) { return static_cast<int>(extent[axis] / step); };
  std::vector<Vector3> inside;
  for (int i = 0; i <= places(0); ++i)
    for (int j = 0; j <= places(1); ++j)
      for (int k = 0; k <= places(2); ++k)
        if (const Vector3 x = lower + step * Vector3(i + 0.5, j + 0.5, k + 0.5); organ->signed_distance(x) < 0)
          inside.push_back(x);
  try {
    regions->require_apart(inside);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}:{}: {}", scenario.file.string(), scenario.regions.front().line, error.what()));
  }
}

std::string regions_text(const std::vector<RegionSettings>& regions) {
  std::string text;
  for (const RegionSettings& region : regions)
    text += fmt::format("{}  region '{}': E = {:.4g} Pa, nu = {:.4g}", text.empty() ? "" : "\n", region.name,
                        region.material.young_modulus, region.material.poisson_ratio);
  return text;
}

} // namespace spherecut::app
