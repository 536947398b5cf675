// Box, half ball and cylinder with closed formulas. All three are convex, so inside the closest surface point lies on
// the nearest face, and outside it is the projection onto the solid; both are exact everywhere.
#include "topology/base/errors.hpp"
#include "topology/domain/domain.hpp"
#include "topology/organ/organs.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <utility>

namespace spherecut::topology {

namespace {

struct Nearest {
  Vector3 point;   // m, on the surface
  Vector3 normal;  // unit, outward
  double distance; // m, negative inside
};

class AnalyticDomain : public Domain {
 public:
  AnalyticDomain(SurfaceMesh surface, std::vector<Plane> planes)
      : surface_(std::move(surface)), planes_(std::move(planes)), bounds_(topology::bounds(surface_)) {}

  [[nodiscard]] double signed_distance(const Vector3& x) const override { return nearest(x).distance; }
  [[nodiscard]] Vector3 normal(const Vector3& x) const override { return nearest(x).normal; }
  [[nodiscard]] Vector3 closest_surface_point(const Vector3& x) const override { return nearest(x).point; }
  [[nodiscard]] const std::vector<Plane>& planes() const override { return planes_; }
  [[nodiscard]] const SurfaceMesh& surface() const override { return surface_; }
  [[nodiscard]] BoundingBox bounds() const override { return bounds_; }

 protected:
  [[nodiscard]] virtual Nearest nearest(const Vector3& x) const = 0;

 private:
  SurfaceMesh surface_;
  std::vector<Plane> planes_;
  BoundingBox bounds_;
};

/// Nearest point for x outside, given its projection onto the solid and the normal of one face there, which stands in
/// when x is so close that the direction away from the projection is lost.
Nearest from_outside(const Vector3& x, const Vector3& projection, const Vector3& face_normal) {
  const Vector3 away = x - projection;
  const double distance = away.norm();
  return {projection, distance > 0 ? Vector3(away / distance) : face_normal, distance};
}

/// Unit vector from the z axis to x; +x on the axis itself.
Vector3 radial_direction(const Vector3& x) {
  const double rho = std::hypot(x.x(), x.y());
  return rho > 0 ? Vector3(x.x() / rho, x.y() / rho, 0) : Vector3::UnitX();
}

class BoxDomain final : public AnalyticDomain {
 public:
  BoxDomain(const Vector3& lower, const Vector3& upper, double edge)
      : AnalyticDomain(make_block(lower, upper, edge), faces(lower, upper)), lower_(lower), upper_(upper) {}

  [[nodiscard]] double curved_distance(const Vector3&) const override {
    return -std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] Vector3 curved_gradient(const Vector3&) const override { return Vector3::Zero(); }

 protected:
  [[nodiscard]] Nearest nearest(const Vector3& x) const override {
    const Plane* face = &planes().front();
    double distance = face->signed_distance(x);
    for (const Plane& plane : planes())
      if (const double d = plane.signed_distance(x); d > distance) {
        distance = d;
        face = &plane;
      }
    const Vector3 projection = x.cwiseMax(lower_).cwiseMin(upper_);
    if (projection != x)
      return from_outside(x, projection, face->normal);
    return {x - distance * face->normal, face->normal, distance};
  }

 private:
  static std::vector<Plane> faces(const Vector3& lower, const Vector3& upper) {
    std::vector<Plane> result;
    for (int d = 0; d < 3; ++d) {
      result.push_back({-Vector3::Unit(d), -lower[d]});
      result.push_back({Vector3::Unit(d), upper[d]});
    }
    return result;
  }

  Vector3 lower_, upper_;
};

/// A box about the origin, seen from a frame in which it is turned and moved.
class TurnedBoxDomain final : public AnalyticDomain {
 public:
  TurnedBoxDomain(const Vector3& centre, const Matrix3& axes, const Vector3& half_size, double edge)
      : AnalyticDomain(turned_block(centre, axes, half_size, edge), faces(centre, axes, half_size)), centre_(centre),
        axes_(axes), half_size_(half_size) {}

  [[nodiscard]] double curved_distance(const Vector3&) const override {
    return -std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] Vector3 curved_gradient(const Vector3&) const override { return Vector3::Zero(); }

 protected:
  [[nodiscard]] Nearest nearest(const Vector3& x) const override {
    // In the box's own axes, so that a point that rounding puts just outside still gets the normal of a face.
    const Vector3 local = axes_.transpose() * (x - centre_);
    int axis = 0;
    const double distance = (local.cwiseAbs() - half_size_).maxCoeff(&axis);
    const Vector3 face = (local[axis] < 0 ? -1.0 : 1.0) * Vector3::Unit(axis);
    const Vector3 projection = local.cwiseMax(-half_size_).cwiseMin(half_size_);
    const Nearest found =
        projection != local ? from_outside(local, projection, face) : Nearest{local - distance * face, face, distance};
    return {centre_ + axes_ * found.point, axes_ * found.normal, found.distance};
  }

 private:
  static SurfaceMesh turned_block(const Vector3& centre, const Matrix3& axes, const Vector3& half_size, double edge) {
    SurfaceMesh mesh = make_block(-half_size, half_size, edge);
    for (Vector3& x : mesh.vertices)
      x = centre + axes * x;
    return mesh;
  }
  static std::vector<Plane> faces(const Vector3& centre, const Matrix3& axes, const Vector3& half_size) {
    std::vector<Plane> result;
    for (int d = 0; d < 3; ++d)
      for (const double side : {-1.0, 1.0}) {
        const Vector3 normal = side * axes.col(d);
        result.push_back({normal, normal.dot(centre) + half_size[d]});
      }
    return result;
  }

  Vector3 centre_;
  Matrix3 axes_;
  Vector3 half_size_;
};

class HemisphereDomain final : public AnalyticDomain {
 public:
  HemisphereDomain(double radius, double edge)
      : AnalyticDomain(make_hemisphere(radius, edge), {{-Vector3::UnitZ(), 0}}), radius_(radius) {}

  [[nodiscard]] double curved_distance(const Vector3& x) const override { return x.norm() - radius_; }
  [[nodiscard]] Vector3 curved_gradient(const Vector3& x) const override {
    const double r = x.norm();
    return r > 0 ? Vector3(x / r) : Vector3::UnitZ();
  }

 protected:
  [[nodiscard]] Nearest nearest(const Vector3& x) const override {
    const double beyond_sphere = curved_distance(x), below_base = -x.z();
    if (below_base <= 0 && beyond_sphere >= below_base) {
      const Vector3 outward = curved_gradient(x);
      return {radius_ * outward, outward, beyond_sphere};
    }
    if (std::hypot(x.x(), x.y()) <= radius_)
      return {{x.x(), x.y(), 0}, -Vector3::UnitZ(), below_base};
    return from_outside(x, radius_ * radial_direction(x), -Vector3::UnitZ());
  }

 private:
  double radius_;
};

class CylinderDomain final : public AnalyticDomain {
 public:
  CylinderDomain(double radius, double height, double edge)
      : AnalyticDomain(make_cylinder(radius, height, edge), {{-Vector3::UnitZ(), 0}, {Vector3::UnitZ(), height}}),
        radius_(radius), height_(height) {}

  [[nodiscard]] double curved_distance(const Vector3& x) const override { return std::hypot(x.x(), x.y()) - radius_; }
  [[nodiscard]] Vector3 curved_gradient(const Vector3& x) const override { return radial_direction(x); }

 protected:
  [[nodiscard]] Nearest nearest(const Vector3& x) const override {
    const double beyond_side = curved_distance(x);
    const bool top = x.z() > height_ / 2;
    const double beyond_cap = top ? x.z() - height_ : -x.z();
    const Vector3 radial = radial_direction(x), cap_normal = (top ? 1 : -1) * Vector3::UnitZ();
    const double cap_height = top ? height_ : 0;
    if (beyond_side > 0 && beyond_cap > 0)
      return from_outside(x, radius_ * radial + Vector3(0, 0, cap_height), cap_normal);
    if (beyond_side >= beyond_cap)
      return {radius_ * radial + Vector3(0, 0, x.z()), radial, beyond_side};
    return {{x.x(), x.y(), cap_height}, cap_normal, beyond_cap};
  }

 private:
  double radius_, height_;
};

} // namespace

std::shared_ptr<const Domain> make_box_domain(const Vector3& lower, const Vector3& upper, double edge) {
  return std::make_shared<BoxDomain>(lower, upper, edge);
}

std::shared_ptr<const Domain> make_turned_box_domain(const Vector3& centre, const Matrix3& axes,
                                                     const Vector3& half_size, double edge) {
  const double error = (axes.transpose() * axes - Matrix3::Identity()).norm();
  if (!(error < 1e-9) || axes.determinant() < 0)
    throw InputError(fmt::format("turned box: its axes are off a rotation by {:.3g}, determinant {:.3g}; the limit is "
                                 "1e-9",
                                 error, axes.determinant()));
  return std::make_shared<TurnedBoxDomain>(centre, axes, half_size, edge);
}

std::shared_ptr<const Domain> make_hemisphere_domain(double radius, double edge) {
  return std::make_shared<HemisphereDomain>(radius, edge);
}

std::shared_ptr<const Domain> make_cylinder_domain(double radius, double height, double edge) {
  return std::make_shared<CylinderDomain>(radius, height, edge);
}

} // namespace spherecut::topology
