// An organ as an implicit solid: exact nearest points near its surface, level-set values where only depth matters.
#include "topology/domain/domain.hpp"
#include "topology/domain/level_set.hpp"
#include "topology/domain/surface_facets.hpp"
#include "topology/surface/distance.hpp"

#include <cmath>
#include <mutex>
#include <utility>

namespace spherecut::topology {

namespace {

/// Farther from the surface than this many voxels the level set's trilinear value answers signed_distance. Its error is
/// below one voxel there, so the sign stays right.
constexpr double exact_voxels = 1.5;

class OrganDomain final : public Domain {
 public:
  OrganDomain(SurfaceMesh surface, double voxel_size)
      : surface_(std::move(surface)), exact_(surface_), level_set_(surface_, voxel_size),
        bounds_(topology::bounds(surface_)) {
    require_outward(surface_);
  }

  [[nodiscard]] double signed_distance(const Vector3& x) const override {
    const double sampled = level_set_.distance(x);
    const double voxel = level_set_.voxel_size();
    // The last voxel of the outer band already mixes in the value that stands for everything farther away.
    const bool known = std::abs(sampled) > exact_voxels * voxel && sampled < level_set_.outside_band() - voxel;
    return known ? sampled : nearest(x).distance;
  }
  [[nodiscard]] double curved_distance(const Vector3& x) const override { return signed_distance(x); }
  [[nodiscard]] Vector3 curved_gradient(const Vector3& x) const override { return nearest(x).normal; }
  [[nodiscard]] Vector3 normal(const Vector3& x) const override { return nearest(x).normal; }
  [[nodiscard]] Vector3 closest_surface_point(const Vector3& x) const override { return nearest(x).point; }
  [[nodiscard]] const std::vector<Plane>& planes() const override { return planes_; }
  [[nodiscard]] const SurfaceMesh& surface() const override { return surface_; }
  [[nodiscard]] BoundingBox bounds() const override { return bounds_; }
  [[nodiscard]] const SurfaceFacets& facets() const {
    std::call_once(facets_made_, [&] { facets_ = std::make_unique<SurfaceFacets>(surface_); });
    return *facets_;
  }

 private:
  [[nodiscard]] NearestPoint nearest(const Vector3& x) const { return exact_.nearest(x, level_set_.near_triangle(x)); }

  SurfaceMesh surface_;
  SurfaceDistance exact_;
  LevelSet level_set_;
  BoundingBox bounds_;
  std::vector<Plane> planes_;
  mutable std::once_flag facets_made_; // one method of three asks for them
  mutable std::unique_ptr<const SurfaceFacets> facets_;
};

} // namespace

const SurfaceFacets* facets_of(const Domain& domain) {
  const auto* organ = dynamic_cast<const OrganDomain*>(&domain);
  return organ == nullptr ? nullptr : &organ->facets();
}

std::shared_ptr<const Domain> make_organ_domain(SurfaceMesh surface, double voxel_size) {
  return std::make_shared<OrganDomain>(std::move(surface), voxel_size);
}

} // namespace spherecut::topology
