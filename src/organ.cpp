#include "src/organ.hpp"

#include "topology/organs.hpp"
#include "topology/surface_check.hpp"

#include <algorithm>

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
    return {topology::make_organ_domain(std::move(surface.mesh), settings.voxel_size), std::move(remarks)};
  }
};

} // namespace

Organ make_organ(const OrganSettings& settings) {
  return std::visit(Maker{settings}, settings.shape);
}

} // namespace spherecut::app
