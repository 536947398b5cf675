// How thick the walls of a body are, and how wide the gaps between parts of its own surface.
#pragma once

#include "topology/surface/mesh.hpp"

#include <functional>
#include <memory>
#include <optional>

namespace spherecut::topology {

/// Width of a wall or gap where a ray from a place of the surface, along its normal, meets the surface again.
struct WidthSample {
  Vector3 point = Vector3::Zero(); // m, half way
  double width = 0;                // m
  double area = 0;                 // m2 of the surface that the ray stands for
  bool is_parallel = false;        // the two places face each other within 25 degrees: a plate, a shell, a slit
};

struct SurfaceWidths {
  std::vector<WidthSample> walls, gaps; // rays into the body, and out of it
};

/// Rays from points of the surface about `apart` m from one another (at most 40000, then farther), inwards as far as
/// they go and outwards up to `reach` m. The mesh is closed and outward. Deterministic.
SurfaceWidths surface_widths(const SurfaceMesh& mesh, double apart, double reach);

/// Samples whose width is below `width`, parallel, and which are no rim or margin: within four times that most of
/// the surface (three quarters) is as thin. Indices, ascending.
std::vector<int> thin_samples(const std::vector<WidthSample>& samples, double width);

/// Places of a triangle evenly spread, about `apart` m from one another there; at least one.
std::vector<Vector3> places_of_triangle(const SurfaceMesh& mesh, int triangle,
                                        const std::function<double(const Vector3&)>& apart);

/// Rays from places of a closed, outward mesh, which has to outlive this. Const calls are thread safe.
class SurfaceRays {
 public:
  explicit SurfaceRays(const SurfaceMesh& mesh);
  ~SurfaceRays();
  SurfaceRays(const SurfaceRays&) = delete;
  SurfaceRays& operator=(const SurfaceRays&) = delete;

  /// Where a ray from `place`, on a side with that normal, along the unit vector `direction` meets the surface within
  /// `reach` m; area 0. Nothing where it does not.
  [[nodiscard]] std::optional<WidthSample> meet(const Vector3& place, const Vector3& normal, const Vector3& direction,
                                                double reach) const;

 private:
  class Caster;
  std::unique_ptr<const Caster> caster_;
};

} // namespace spherecut::topology
