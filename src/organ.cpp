#include "src/organ.hpp"

#include "topology/errors.hpp"
#include "topology/organs.hpp"
#include "topology/surface_check.hpp"

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
    topology::CheckedSurface surface = topology::read_surface(organ.file, organ.scale);
    std::vector<std::string> remarks = std::move(surface.mended);
    remarks.insert(remarks.end(), surface.warnings.begin(), surface.warnings.end());
    try {
      return {topology::make_organ_domain(std::move(surface.mesh), settings.voxel_size), std::move(remarks)};
    } catch (const InputError& error) {
      throw InputError(fmt::format("{} (organ.scale = {:g}): {}", organ.file.string(), organ.scale, error.what()));
    }
  }
};

} // namespace

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
