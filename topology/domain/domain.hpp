// The body at rest as an implicit solid: what the mechanics needs to know of geometry.
#pragma once

#include "topology/surface/mesh.hpp"

#include <memory>
#include <string>

namespace spherecut::topology {

/// A closed solid. It is the intersection of the half-spaces planes() with the solid curved_distance(x) < 0; either
/// part may be absent. Planar parts are kept apart because cells can be clipped by them exactly.
class Domain {
 public:
  virtual ~Domain() = default;

  /// Signed distance to the surface, m, negative inside. Exact in sign; exact in value near the surface.
  [[nodiscard]] virtual double signed_distance(const Vector3& x) const = 0;

  /// Signed distance to the curved part alone, m (minus infinity when there is none; its gradient is then zero).
  [[nodiscard]] virtual double curved_distance(const Vector3& x) const = 0;

  /// Unit outward gradient of curved_distance.
  [[nodiscard]] virtual Vector3 curved_gradient(const Vector3& x) const = 0;

  /// Unit outward normal: gradient of signed_distance (one-sided at edges).
  [[nodiscard]] virtual Vector3 normal(const Vector3& x) const = 0;

  /// Closest point on the surface of the solid.
  [[nodiscard]] virtual Vector3 closest_surface_point(const Vector3& x) const = 0;

  /// Exact planar faces.
  [[nodiscard]] virtual const std::vector<Plane>& planes() const = 0;

  /// Tessellation of the surface: closed, outward. Its vertices lie on the surface.
  [[nodiscard]] virtual const SurfaceMesh& surface() const = 0;

  [[nodiscard]] virtual BoundingBox bounds() const = 0;
};

/// Box lower..upper, m. Tessellated with edges of about `edge` m.
std::shared_ptr<const Domain> make_box_domain(const Vector3& lower, const Vector3& upper, double edge);

/// Box of edges 2 half_size about `centre` along the columns of `axes`. Tessellated with edges of about `edge` m.
/// Throws InputError when `axes` is not a rotation to 1e-9.
std::shared_ptr<const Domain> make_turned_box_domain(const Vector3& centre, const Matrix3& axes,
                                                     const Vector3& half_size, double edge);

/// Half ball of the given radius, base on z = 0, pole at +z.
std::shared_ptr<const Domain> make_hemisphere_domain(double radius, double edge);

/// Upright cylinder: axis z, base on z = 0.
std::shared_ptr<const Domain> make_cylinder_domain(double radius, double height, double edge);

/// An organ given by a checked closed surface; it has no planes and its curved distance is its distance. Distances come
/// from the exact nearest point of the triangles, signed by pseudonormals (surface_distance.hpp), except that farther
/// from the surface than 1.5 voxels signed_distance is read from an OpenVDB level set (level_set.hpp, which states its
/// error) of the given voxel size, m (0: derived as 1/128 of the largest extent). The sign is right everywhere. Normals
/// and closest points are always exact. Const calls are thread safe. Throws InputError when the surface is not closed,
/// oriented inwards, or the voxel size does not fit it.
std::shared_ptr<const Domain> make_organ_domain(SurfaceMesh surface, double voxel_size = 0);

} // namespace spherecut::topology
