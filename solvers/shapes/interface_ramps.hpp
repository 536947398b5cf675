// Shape functions beside a face between two materials, where the displacement has a kink.
//
// Strain jumps across such a face, and smooth shape functions cannot follow. So the moving least squares basis of a
// point x has one function more for every face near it: the ramp r(y), the distance of y to the tangent plane of the
// face where it is nearest to x, beyond that plane, and 0 on the side of x. Piecewise linear fields with a kink in a
// flat face are reproduced as linear ones are [Krongauz 1998 adds such functions with unknowns of their own]. From both
// sides of a face the basis spans the same functions, and nodes beyond the plane lose their say the less of the support
// they are: the shape functions are continuous across the face and where supports begin to reach over it.
#pragma once

#include "solvers/elasticity/regions.hpp"
#include "solvers/shapes/kernel.hpp"

namespace spherecut::solvers {

/// What the spheres of a node cloud know of the faces between materials. Immutable once built; queries are thread safe.
class InterfaceRamps {
 public:
  InterfaceRamps(std::shared_ptr<const MaterialRegions> regions, const std::vector<Vector3>& centres,
                 const std::vector<double>& radii);

  /// Whether a face may pass between the node and a point in its sphere.
  [[nodiscard]] bool concerns(int node) const { return concern_[node] != 0; }
  [[nodiscard]] bool concerns(const shape_kernel::Support& support) const {
    unsigned any = 0;
    for (int k = 0; k < support.count; ++k)
      any |= concern_[support.ids[k]];
    return any != 0;
  }

  enum class Outcome {
    plain,   // no node of the support lies across a face: the linear basis does, `out` holds nothing
    sound,   // `out` holds the shape functions
    unsound, // too few nodes for the basis, or a moment matrix worse conditioned than allowed
  };
  /// Shape functions at x and their exact gradients on the nodes of `support`, all whose spheres hold x. Throws
  /// InputError where more faces than most_ramps divide the support.
  Outcome evaluate(const Vector3& x, const shape_kernel::Support& support, double worst_condition,
                   ShapeFunctions& out) const;

  static constexpr int most_ramps = 8; // of one point

 private:
  /// Tangent plane of a face, as the point sees it.
  struct TangentPlane {
    double distance; // of the point, m; negative on the side of the region
    Vector3 normal;
    Matrix3 turning; // 1/m
    /// Signed distance of the place x + d, m.
    [[nodiscard]] double of(const Vector3& d) const { return distance + normal.dot(d); }
    [[nodiscard]] bool is_beyond(const Vector3& d) const { return (of(d) < 0) != (distance < 0); }
  };
  struct Crossed {
    std::array<TangentPlane, most_ramps> planes;
    int count = 0;
  };
  [[nodiscard]] Crossed faces_crossed(const Vector3& x, const shape_kernel::Support& support) const;

  std::shared_ptr<const MaterialRegions> regions_;
  std::vector<std::uint8_t> concern_; // per node
};

} // namespace spherecut::solvers
