#include "solvers/elasticity/regions.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {

bool MaterialRegion::holds(const Vector3& x) const {
  return std::all_of(faces.begin(), faces.end(), [&](const RegionFace& face) { return face.distance(x) < 0; });
}

double MaterialRegion::depth(const Vector3& x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const RegionFace& face : faces)
    least = std::min(least, -face.distance(x));
  return least;
}

std::vector<RegionFace> half_space_faces(const Plane& plane) {
  return {{[plane](const Vector3& x) { return plane.signed_distance(x); },
           [plane](const Vector3&) -> Vector3 { return plane.normal; }}};
}

std::vector<RegionFace> slab_faces(const Plane& plane, double thickness) {
  std::vector<RegionFace> faces = half_space_faces(plane);
  const Plane other{-plane.normal, thickness - plane.offset};
  faces.push_back(half_space_faces(other).front());
  return faces;
}

std::vector<RegionFace> ball_faces(const Vector3& centre, double radius) {
  const auto normal = [centre](const Vector3& x) -> Vector3 {
    const Vector3 arm = x - centre;
    const double r = arm.norm();
    return r > 0 ? Vector3(arm / r) : Vector3(Vector3::UnitZ());
  };
  const auto turning = [centre, normal](const Vector3& x) -> Matrix3 {
    const double r = (x - centre).norm();
    const Vector3 n = normal(x);
    return r > 0 ? Matrix3((Matrix3::Identity() - n * n.transpose()) / r) : Matrix3(Matrix3::Zero());
  };
  return {{[centre, radius](const Vector3& x) { return (x - centre).norm() - radius; }, normal, turning}};
}

std::vector<RegionFace> box_faces(const Vector3& lower, const Vector3& upper) {
  std::vector<RegionFace> faces;
  for (int axis = 0; axis < 3; ++axis)
    for (const RegionFace& face : slab_faces({Vector3::Unit(axis), upper[axis]}, upper[axis] - lower[axis]))
      faces.push_back(face);
  return faces;
}

namespace {

/// Depth from a surface, or height above it, as a face: `side` times the distance to the solid, plus an offset.
RegionFace offset_face(const std::shared_ptr<const topology::Domain>& solid, double side, double offset) {
  const double step = 1e-3 * solid->bounds().extent().maxCoeff(); // of the differences of a normal
  return {[solid, side, offset](const Vector3& x) { return side * solid->signed_distance(x) + offset; },
          [solid, side](const Vector3& x) -> Vector3 { return side * solid->normal(x); },
          [solid, side, step](const Vector3& x) {
            Matrix3 turning;
            for (int axis = 0; axis < 3; ++axis) {
              const Vector3 aside = step * Vector3::Unit(axis);
              turning.col(axis) = side / (2 * step) * (solid->normal(x + aside) - solid->normal(x - aside));
            }
            return turning;
          }};
}

} // namespace

std::vector<RegionFace> solid_faces(const std::shared_ptr<const topology::Domain>& solid) {
  return {offset_face(solid, 1, 0)};
}

std::vector<RegionFace> depth_faces(const std::shared_ptr<const topology::Domain>& body, double from, double to) {
  std::vector<RegionFace> faces{offset_face(body, -1, -to)};
  if (from > 0)
    faces.push_back(offset_face(body, 1, from));
  return faces;
}

MaterialRegions::MaterialRegions(std::vector<MaterialRegion> regions) : regions_(std::move(regions)) {
  if (regions_.empty())
    throw InputError("material regions: there are none; allowed: one or more");
  for (const MaterialRegion& region : regions_) {
    if (region.faces.empty())
      throw InputError(fmt::format("material region '{}' has no faces; allowed: one or more", region.name));
    try {
      region.material.check();
    } catch (const InputError& error) {
      throw InputError(fmt::format("material region '{}': {}", region.name, error.what()));
    }
    faces_.insert(faces_.end(), region.faces.begin(), region.faces.end());
  }
}

int MaterialRegions::at(const Vector3& x) const {
  const auto found =
      std::find_if(regions_.begin(), regions_.end(), [&](const MaterialRegion& region) { return region.holds(x); });
  return found == regions_.end() ? -1 : static_cast<int>(found - regions_.begin());
}

const Material& MaterialRegions::material_at(const Vector3& x, const Material& elsewhere) const {
  const int region = at(x);
  return region < 0 ? elsewhere : regions_[region].material;
}

double MaterialRegions::stiffest_near(const Vector3& x, double reach, const Material& elsewhere) const {
  double stiffest = 0;
  bool is_deep = false; // in some region
  for (const MaterialRegion& region : regions_) {
    const double depth = region.depth(x);
    is_deep = is_deep || depth > reach;
    if (depth > -reach)
      stiffest = std::max(stiffest, region.material.young_modulus);
  }
  return is_deep ? stiffest : std::max(stiffest, elsewhere.young_modulus);
}

void MaterialRegions::require_apart(std::span<const Vector3> points) const {
  for (const Vector3& x : points) {
    const MaterialRegion* first = nullptr;
    for (const MaterialRegion& region : regions_) {
      if (!region.holds(x))
        continue;
      if (first != nullptr)
        throw InputError(fmt::format("material regions '{}' and '{}' overlap: both hold ({:.6g}, {:.6g}, {:.6g}) m; "
                                     "allowed: regions apart from each other, or that share a face",
                                     first->name, region.name, x.x(), x.y(), x.z()));
      first = &region;
    }
  }
}

void MaterialRegions::require_resolved(std::span<const Vector3> points, double spacing) const {
  for (const MaterialRegion& region : regions_)
    if (std::none_of(points.begin(), points.end(), [&](const Vector3& x) { return region.holds(x); }))
      throw InputError(fmt::format("material region '{}' holds none of the {} quadrature points of the body: it lies "
                                   "outside it, or is too small for nodes {:.4g} m apart; allowed: a region within the "
                                   "body of about that size at least",
                                   region.name, points.size(), spacing));
}

} // namespace spherecut::solvers
