#include "src/model/organ.hpp"

#include "topology/base/errors.hpp"
#include "topology/files/label_volume.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <mutex>

namespace spherecut::app {
namespace {

constexpr double edges_along = 40; // mesh edges along the largest size of a built-in solid

double edge_or(const OrganSettings& settings, double largest_size) {
  return settings.edge > 0 ? settings.edge : largest_size / edges_along;
}

struct Maker {
  const OrganSettings& settings;

  Organ operator()(const BlockOrgan& block) const {
    const Vector3 half(0.5 * block.size.x(), 0.5 * block.size.y(), 0);
    return {topology::make_box_domain(-half, half + Vector3(0, 0, block.size.z()),
                                      edge_or(settings, block.size.maxCoeff())),
            {}};
  }
  Organ operator()(const CylinderOrgan& cylinder) const {
    const double edge = edge_or(settings, std::max(2 * cylinder.radius, cylinder.height));
    return {topology::make_cylinder_domain(cylinder.radius, cylinder.height, edge), {}};
  }
  Organ operator()(const HemisphereOrgan& hemisphere) const {
    return {topology::make_hemisphere_domain(hemisphere.radius, edge_or(settings, 2 * hemisphere.radius)), {}};
  }
  Organ operator()(const LiverOrgan& liver) const {
    return {topology::make_organ_domain(topology::make_liver(liver.triangles), settings.voxel_size), {}};
  }
  Organ operator()(const FileOrgan& organ) const {
    topology::CheckedSurface surface = read_organ_surface(organ);
    std::vector<std::string> remarks = std::move(surface.mended);
    remarks.insert(remarks.end(), surface.warnings.begin(), surface.warnings.end());
    try {
      return {topology::make_organ_domain(std::move(surface.mesh), settings.voxel_size), std::move(remarks)};
    } catch (const InputError& error) {
      const std::string scale = organ.scale > 0 ? fmt::format(" (organ.scale = {:g})", organ.scale) : "";
      throw InputError(fmt::format("{}{}: {}", organ.file.string(), scale, error.what()));
    }
  }
};

} // namespace

topology::CheckedSurface read_organ_surface(const FileOrgan& organ) {
  if (!topology::is_label_volume(organ.file))
    return topology::read_surface(organ.file, organ.scale > 0 ? organ.scale : 1, organ.choices);
  const std::string name = organ.file.string();
  topology::LabelSurface made =
      topology::label_surface(topology::read_label_volume(organ.file, organ.scale), organ.label, name);
  topology::CheckedSurface surface = topology::check_surface(made.soup, name, organ.choices);
  surface.mended.insert(surface.mended.begin(), made.remarks.begin(), made.remarks.end());
  return surface;
}

void write_organ_surface(const OrganSettings& settings, const std::filesystem::path& file) {
  if (std::filesystem::exists(file))
    throw InputError(fmt::format("{}: is there already; allowed: a name that is not taken", file.string()));
  const auto* from_file = std::get_if<FileOrgan>(&settings.shape);
  topology::SurfaceMesh mesh =
      from_file != nullptr ? read_organ_surface(*from_file).mesh : make_organ(settings).domain->surface();
  if (from_file != nullptr && from_file->scale > 0 && !topology::is_label_volume(from_file->file))
    for (Vector3& v : mesh.vertices)
      v /= from_file->scale;
  topology::write_surface(file, mesh);
}

Organ make_organ(const OrganSettings& settings) {
  // A liver is what its settings say and never changes: a session that is made beside another of the same (a reset)
  // shares it with its level set, which take most of the time to make one.
  struct Kept {
    int triangles = 0;
    double voxel_size = 0;
    std::weak_ptr<const topology::Domain> domain;
  };
  static std::mutex mutex;
  static Kept kept;
  const auto* liver = std::get_if<LiverOrgan>(&settings.shape);
  if (liver == nullptr)
    return std::visit(Maker{settings}, settings.shape);
  const std::lock_guard lock(mutex);
  if (kept.triangles == liver->triangles && kept.voxel_size == settings.voxel_size)
    if (auto domain = kept.domain.lock())
      return {std::move(domain), {}};
  Organ organ = std::visit(Maker{settings}, settings.shape);
  kept = {liver->triangles, settings.voxel_size, organ.domain};
  return organ;
}

} // namespace spherecut::app
