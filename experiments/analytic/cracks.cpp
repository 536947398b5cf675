#include "experiments/analytic/cracks.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <complex>
#include <numbers>

namespace spherecut::experiments {

using std::numbers::pi;

Vector3 CutFrame::local(const Vector3& x) const {
  const Vector3 d = x - origin;
  return {d.dot(ahead), d.dot(normal), d.dot(tangent)};
}

Vector3 CutFrame::global(const Vector3& v) const {
  return v[0] * ahead + v[1] * normal + v[2] * tangent;
}

CutFrame tilted_frame(const Vector3& origin, const Vector3& tilt) {
  const double angle = tilt.norm();
  const Matrix3 turn = angle > 0 ? Eigen::AngleAxisd(angle, tilt / angle).toRotationMatrix() : Matrix3::Identity();
  return {origin, turn.col(0), turn.col(2), turn.col(1)};
}

CutFrame placed_frame(Placement placement, const Vector3& origin, const Vector3& tilt) {
  return placement == Placement::tilted ? tilted_frame(origin, tilt) : CutFrame{};
}

Vector3 straight_crack_displacement(const solvers::Material& material, const CutFrame& frame,
                                    const solvers::Intensities& k, const Vector3& x) {
  const Vector3 at = frame.local(x);
  return frame.global(solvers::tip_field(material, k, at[0], at[1]).displacement);
}

// Harmonic potential phi of the half-space z >= 0 with s = z + i a, R = sqrt(r^2 + s^2), L = ln(s + R), c = -2 p / pi:
//   2 mu u_r = (1 - 2 nu) phi_r + z phi_rz,  2 mu u_z = -2 (1 - nu) phi_z + z phi_zz.
Vector3 penny_displacement(const solvers::Material& material, const CutFrame& frame, double radius, double pressure,
                           const Vector3& x) {
  using Complex = std::complex<double>;
  const Vector3 d = x - frame.origin;
  const double height = d.dot(frame.normal), side = height >= 0 ? 1 : -1;
  const Vector3 in_plane = d - height * frame.normal;
  const double z = std::max(std::abs(height), 1e-12 * radius), r = std::max(in_plane.norm(), 1e-9 * radius);
  const double nu = material.poisson_ratio, mu = material.shear_modulus(), c = -2 * pressure / pi;
  const Complex i(0, 1), s(z, radius);
  Complex root = std::sqrt(r * r + s * s);
  if (root.real() < 0)
    root = -root;
  const Complex log = std::log(s + root);
  const double phi_z = c * std::imag(root - z * log), phi_zz = c * std::imag(i * radius / root - log);
  const double phi_r = c / r * std::imag((s * root + r * r * log) / 2.0 - z * z / 2 - i * radius * root);
  const double phi_rz = c * std::imag(root / r - i * radius * s / (r * root));
  const double u_r = ((1 - 2 * nu) * phi_r + z * phi_rz) / (2 * mu);
  const double u_z = (-2 * (1 - nu) * phi_z + z * phi_zz) / (2 * mu);
  return u_r / r * in_plane + side * u_z * frame.normal;
}

// A unit force along k at x makes, at the distance R from it (R counted from the force),
//   sigma_ij = -[3 R_i R_j R_k / R^3 + (1 - 2 nu)(delta_ik R_j + delta_jk R_i - delta_ij R_k)/R] / (8 pi (1 - nu) R^2);
// by reciprocity u_k(x) is the work of these stresses on the jump of the faces.
Vector3 ellipse_jump_displacement(const solvers::Material& material, const CutFrame& frame, double a, double b,
                                  const std::function<Vector3(double x, double y)>& shape, const Vector3& x, int rings,
                                  int sectors) {
  const double nu = material.poisson_ratio;
  const Vector3 n = frame.normal;
  Vector3 u = Vector3::Zero();
  double volume = 0; // of the half ellipsoid over the unit disc: the rule is scaled to have it right
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sectors; ++j) {
      // r = sin t: sqrt(1 - r^2) r dr is smooth in t.
      const double t = 0.5 * pi * (i + 0.5) / rings, w = 2 * pi * (j + 0.5) / sectors;
      const double r = std::sin(t), depth = std::cos(t);
      const double area = r * depth * (0.5 * pi / rings) * (2 * pi / sectors);
      volume += area * depth;
      const double along = a * r * std::cos(w), across = b * r * std::sin(w);
      const Vector3 to = frame.origin + along * frame.ahead + across * frame.tangent - x;
      const double distance = to.norm();
      const Vector3 e = to / distance, d = depth * shape(along, across);
      u += area / (8 * pi * (1 - nu) * distance * distance) *
           (3 * e.dot(d) * e.dot(n) * e + (1 - 2 * nu) * (d * e.dot(n) + n * e.dot(d) - e * d.dot(n)));
    }
  return -2 * pi / 3 / volume * a * b * u;
}

Vector3 loaded_penny_displacement(const solvers::Material& material, const CutFrame& frame, double radius,
                                  const Matrix3& stress, const Vector3& x) {
  const double nu = material.poisson_ratio, mu = material.shear_modulus();
  const Vector3 n = frame.normal, load = stress * n;
  const Vector3 across = load.dot(n) * n, along = load - across;
  const Vector3 jump = // of the faces at the centre
      radius * (4 * (1 - nu) / (pi * mu) * across + 8 * (1 - nu) / (pi * mu * (2 - nu)) * along);
  return ellipse_jump_displacement(
      material, frame, radius, radius, [&jump](double, double) -> const Vector3& { return jump; }, x, 16, 24);
}

double ellipse_opening(const solvers::Material& material, double a, double b, double pressure) {
  const double nu = material.poisson_ratio, modulus = std::sqrt(1 - b * b / (a * a));
  return 4 * (1 - nu * nu) * pressure * b / (material.young_modulus * std::comp_ellint_2(modulus));
}

double ellipse_intensity(double a, double b, double pressure, double t) {
  const double ratio = b / a, c = ratio * std::cos(t), s = std::sin(t);
  return pressure * std::sqrt(pi * b) * std::pow(s * s + c * c, 0.25) /
         std::comp_ellint_2(std::sqrt(1 - ratio * ratio));
}

double torsion_turn(const solvers::Material& material, double radius, double shear, double r) {
  return 8 * shear * std::sqrt(std::max(0.0, radius * radius - r * r)) / (3 * pi * material.shear_modulus() * radius);
}

double torsion_intensity(double radius, double shear) {
  return 4 * shear * std::sqrt(radius / pi) / 3;
}

solvers::Intensities lens_intensities(double sphere, double tension) {
  const double k = 2 * tension * std::sqrt(sphere * std::sqrt(0.5) / pi);
  return {0.877 * k, -0.235 * k, 0};
}

double penny_opening(const solvers::Material& material, double radius, double pressure, double r) {
  const double nu = material.poisson_ratio;
  return 8 * (1 - nu * nu) * pressure * std::sqrt(std::max(0.0, radius * radius - r * r)) /
         (pi * material.young_modulus);
}

double penny_opening_volume(const solvers::Material& material, double radius, double pressure) {
  const double nu = material.poisson_ratio;
  return 16 * (1 - nu * nu) * pressure * radius * radius * radius / (3 * material.young_modulus);
}

// The + face slides over the - face along the shear.
solvers::Intensities penny_intensities(const solvers::Material& material, double radius, double normal, double shear,
                                       double w) {
  const double nu = material.poisson_ratio, root = std::sqrt(radius / pi);
  return {2 * normal * root, 4 * shear * std::cos(w) * root / (2 - nu),
          -4 * (1 - nu) * shear * std::sin(w) * root / (2 - nu)};
}

solvers::Intensities tilted_penny_intensities(const solvers::Material& material, double radius, double tension,
                                              double tilt, double w) {
  return penny_intensities(material, radius, tension * std::cos(tilt) * std::cos(tilt),
                           tension * std::sin(tilt) * std::cos(tilt), w);
}

double edge_notched_strip_intensity(double tension, double crack, double width) {
  const double x = crack / width, half = pi * x / 2;
  const double shape =
      std::sqrt(std::tan(half) / half) * (0.752 + 2.02 * x + 0.37 * std::pow(1 - std::sin(half), 3)) / std::cos(half);
  return tension * std::sqrt(pi * crack) * shape;
}

} // namespace spherecut::experiments
