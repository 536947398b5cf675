#include "topology/domain/level_set.hpp"

#include "topology/base/errors.hpp"
#include "topology/surface/pieces.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <limits>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/task_arena.h>
#include <vector>

namespace spherecut::topology {

namespace {

constexpr float band_voxels = 4;           // outside
constexpr double default_resolution = 128; // voxels along the largest extent
constexpr double least_voxels_across = 4;
constexpr double smallest_voxel = 2e-5; // m: OpenVDB takes no smaller scale, whose cube it holds for zero
constexpr double bytes_per_voxel = sizeof(float) + sizeof(std::int32_t);
constexpr double fill_of_leaves = 0.5; // share of allocated leaf voxels that the body and its band use, at least

/// The surface in index space, as the conversion takes it that is compiled in OpenVDB's library: an own type of surface
/// would have half a minute of templates compiled here.
class IndexSpaceMesh {
 public:
  IndexSpaceMesh(const SurfaceMesh& surface, double voxel_size) {
    points_.reserve(surface.vertices.size());
    for (const Vector3& x : surface.vertices)
      points_.emplace_back(x.x() / voxel_size, x.y() / voxel_size, x.z() / voxel_size);
    triangles_.reserve(surface.triangles.size());
    for (const Triangle& t : surface.triangles)
      triangles_.emplace_back(t[0], t[1], t[2]);
  }
  openvdb::FloatGrid::Ptr distances(const openvdb::math::Transform& transform, float inside, int flags,
                                    openvdb::Int32Grid* nearest = nullptr) const {
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(points_, triangles_);
    openvdb::util::NullInterrupter never;
    return openvdb::tools::meshToVolume<openvdb::FloatGrid>(never, mesh, transform, band_voxels, inside, flags,
                                                            nearest);
  }

 private:
  std::vector<openvdb::Vec3s> points_;
  std::vector<openvdb::Vec3I> triangles_;
};

/// The triangles of the components that lie within `depth` others.
SurfaceMesh nested_part(const SurfaceMesh& surface, const SurfaceComponents& found, std::size_t depth) {
  SurfaceMesh part;
  part.vertices = surface.vertices;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    if (found.components[found.of[t]].within.size() == depth)
      part.triangles.push_back(surface.triangles[t]);
  return part;
}

/// Distances by OpenVDB. It takes for inside whatever cannot be reached from without, cavities too and what floats in
/// them: there the sign is turned. Walls within the outermost are to stay where there are such (a wall that passes
/// through another would else leave a trace inside).
openvdb::FloatGrid::Ptr sampled_distances(const SurfaceMesh& surface, double voxel_size,
                                          const openvdb::math::Transform& transform, openvdb::Int32Grid& triangles) {
  using namespace openvdb::tools;
  const SurfaceComponents found = find_components(surface);
  std::size_t deepest = 0;
  for (const SurfaceComponent& component : found.components)
    deepest = std::max(deepest, component.within.size());
  constexpr float everywhere = std::numeric_limits<float>::max();
  const auto distances =
      IndexSpaceMesh(surface, voxel_size)
          .distances(transform, everywhere,
                     DISABLE_RENORMALIZATION | (deepest > 0 ? DISABLE_INTERSECTING_VOXEL_REMOVAL : 0), &triangles);
  auto values = distances->getAccessor();
  for (std::size_t depth = 1; depth <= deepest; ++depth) {
    const SurfaceMesh part = nested_part(surface, found, depth);
    const auto nested = IndexSpaceMesh(part, voxel_size).distances(transform, everywhere, DISABLE_RENORMALIZATION);
    for (auto it = nested->cbeginValueAll(); it; ++it) {
      if (!(*it < 0))
        continue;
      for (const openvdb::Coord& voxel : it.getBoundingBox()) {
        const float distance = std::abs(values.getValue(voxel));
        values.setValue(voxel, depth % 2 == 1 ? std::min(distance, distances->background()) : -distance);
      }
    }
  }
  return distances;
}

double checked_voxel_size(const SurfaceMesh& surface, double voxel_size, std::size_t memory_limit) {
  if (surface.triangles.empty())
    throw InputError("level set: the surface has no triangles");
  for (std::size_t v = 0; v < surface.vertices.size(); ++v)
    if (!surface.vertices[v].allFinite())
      throw InputError(fmt::format("level set: vertex {} is not finite", v));
  const Vector3 extent = bounds(surface).extent();
  const double limit = extent.minCoeff() / least_voxels_across;
  if (limit < smallest_voxel)
    throw InputError(fmt::format("the body measures {:.4g} m across: allowed: at least {:.4g} m; is its scale right?",
                                 extent.minCoeff(), least_voxels_across * smallest_voxel));
  if (voxel_size == 0)
    voxel_size = std::clamp(extent.maxCoeff() / default_resolution, smallest_voxel, limit);
  if (!(std::isfinite(voxel_size) && voxel_size > 0 && voxel_size <= limit))
    throw InputError(fmt::format("voxel size = {} m: must be positive and at most {:.4g} m, a quarter of the smallest "
                                 "extent of the surface",
                                 voxel_size, limit));
  const double voxels =
      std::abs(volume(surface)) / std::pow(voxel_size, 3) + band_voxels * area(surface) / std::pow(voxel_size, 2);
  const double bytes = voxels * bytes_per_voxel / fill_of_leaves;
  if (bytes > static_cast<double>(memory_limit))
    throw InputError(fmt::format("voxel size = {} m would need about {:.2g} GB for the level set: at most {:.2g} GB",
                                 voxel_size, bytes / 1e9, static_cast<double>(memory_limit) / 1e9));
  if (voxel_size < smallest_voxel)
    throw InputError(fmt::format("voxel size = {} m: allowed: at least {:g} m", voxel_size, smallest_voxel));
  return voxel_size;
}

} // namespace

struct LevelSet::Impl {
  using Accessor = openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>;

  [[nodiscard]] openvdb::Vec3d index_space(const Vector3& x) const {
    return {x.x() / voxel_size, x.y() / voxel_size, x.z() / voxel_size};
  }

  /// Trilinear value at index coordinates p.
  static double sample(const Accessor& values, const openvdb::Vec3d& p) {
    const openvdb::Coord c = openvdb::Coord::floor(p);
    const double u = p.x() - c.x(), v = p.y() - c.y(), w = p.z() - c.z();
    const auto at = [&](int i, int j, int k) { return static_cast<double>(values.getValue(c.offsetBy(i, j, k))); };
    const auto along_z = [&](int i, int j) { return (1 - w) * at(i, j, 0) + w * at(i, j, 1); };
    const auto along_y = [&](int i) { return (1 - v) * along_z(i, 0) + v * along_z(i, 1); };
    return (1 - u) * along_y(0) + u * along_y(1);
  }

  /// Index coordinates beyond what a voxel coordinate can hold lie far outside.
  [[nodiscard]] static bool representable(const openvdb::Vec3d& p) {
    constexpr double limit = 1e9;
    return std::abs(p.x()) < limit && std::abs(p.y()) < limit && std::abs(p.z()) < limit;
  }

  double voxel_size = 0;
  openvdb::FloatGrid::Ptr distances;
  openvdb::Int32Grid::Ptr triangles;
};

LevelSet::LevelSet(const SurfaceMesh& surface, double voxel_size, std::size_t memory_limit)
    : impl_(std::make_unique<Impl>()) {
  openvdb::initialize();
  impl_->voxel_size = checked_voxel_size(surface, voxel_size, memory_limit);
  const auto transform = openvdb::math::Transform::createLinearTransform(impl_->voxel_size);
  impl_->triangles = openvdb::Int32Grid::create(-1);
  // One thread: which of two equally near triangles a voxel keeps must not depend on the schedule.
  tbb::task_arena one_thread(1);
  one_thread.execute(
      [&] { impl_->distances = sampled_distances(surface, impl_->voxel_size, *transform, *impl_->triangles); });
}

LevelSet::~LevelSet() = default;
LevelSet::LevelSet(LevelSet&&) noexcept = default;
LevelSet& LevelSet::operator=(LevelSet&&) noexcept = default;

double LevelSet::distance(const Vector3& x) const {
  const openvdb::Vec3d p = impl_->index_space(x);
  if (!Impl::representable(p))
    return outside_band();
  return Impl::sample(Impl::Accessor(impl_->distances->tree()), p);
}

Vector3 LevelSet::gradient(const Vector3& x) const {
  const openvdb::Vec3d p = impl_->index_space(x);
  if (!Impl::representable(p))
    return Vector3::Zero();
  const Impl::Accessor values(impl_->distances->tree());
  Vector3 result;
  for (int d = 0; d < 3; ++d) {
    openvdb::Vec3d step(0.0);
    step[d] = 0.5;
    result[d] = (Impl::sample(values, p + step) - Impl::sample(values, p - step)) / impl_->voxel_size;
  }
  return result;
}

bool LevelSet::inside(const Vector3& x) const {
  return distance(x) < 0;
}

int LevelSet::near_triangle(const Vector3& x) const {
  const openvdb::Vec3d p = impl_->index_space(x);
  return Impl::representable(p) ? impl_->triangles->tree().getValue(openvdb::Coord::round(p)) : -1;
}

void LevelSet::visit_inside(
    const std::function<void(const std::array<int, 3>&, const std::array<int, 3>&)>& visit) const {
  const auto as_array = [](const openvdb::Coord& c) { return std::array<int, 3>{c.x(), c.y(), c.z()}; };
  for (auto it = impl_->distances->cbeginValueAll(); it; ++it)
    if (*it < 0) {
      const openvdb::CoordBBox box = it.getBoundingBox();
      visit(as_array(box.min()), as_array(box.max()));
    }
}

double LevelSet::voxel_size() const {
  return impl_->voxel_size;
}
double LevelSet::outside_band() const {
  return band_voxels * impl_->voxel_size;
}
std::size_t LevelSet::memory_bytes() const {
  return impl_->distances->memUsage() + impl_->triangles->memUsage();
}
std::size_t LevelSet::active_voxels() const {
  return impl_->distances->activeVoxelCount();
}

} // namespace spherecut::topology
