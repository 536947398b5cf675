// Exact fields and intensities of cracks in linear elasticity.
#pragma once

#include "solvers/fracture/stress_intensity.hpp"

#include <functional>

namespace spherecut::experiments {

/// Axes of a plane cut: the front runs along `tangent` = normal x ahead through `origin`, or around it.
struct CutFrame {
  Vector3 origin = Vector3::Zero();
  Vector3 ahead = Vector3::UnitX(), normal = Vector3::UnitZ(), tangent = Vector3::UnitY();
  /// (ahead, normal, tangent) components of x - origin.
  [[nodiscard]] Vector3 local(const Vector3& x) const;
  [[nodiscard]] Vector3 global(const Vector3& v) const;
};

/// Frame whose normal is (0, 0, 1) and whose way ahead is (1, 0, 0), tilted by the rotation vector `tilt` (rad) and
/// moved.
CutFrame tilted_frame(const Vector3& origin, const Vector3& tilt);

/// How a cut lies to the axes, and with them to the faces of its body and to the background cells.
enum class Placement {
  tilted, // aligned with nothing
  aligned // its frame is the axes about 0
};
/// tilted_frame(), or the axes about 0.
CutFrame placed_frame(Placement placement, const Vector3& origin, const Vector3& tilt);

/// Field of a half-plane crack behind the straight front of `frame` (mode I, II, III) [Williams 1957], m.
Vector3 straight_crack_displacement(const solvers::Material& material, const CutFrame& frame,
                                    const solvers::Intensities& k, const Vector3& x);

/// Crack of radius a about frame.origin in the plane across frame.normal in an infinite body, faces under pressure p
/// [Sneddon 1946], m. On the crack itself the face is that of the side x lies on.
Vector3 penny_displacement(const solvers::Material& material, const CutFrame& frame, double radius, double pressure,
                           const Vector3& x);
/// Opening u+ - u- along the normal at distance r < a from the centre, 8 (1 - nu^2) p sqrt(a^2 - r^2) / (pi E), m.
double penny_opening(const solvers::Material& material, double radius, double pressure, double r);
/// Its volume, 16 (1 - nu^2) p a^3 / (3 E), m3.
double penny_opening_volume(const solvers::Material& material, double radius, double pressure);

/// Displacement around the same crack when its faces carry the traction -stress n (n out of the material), as remote
/// stress does to the part of the field that the crack adds: opening and sliding of the faces are ellipsoids, and the
/// field is theirs by the formula for dislocation loops [Volterra 1907]. Good from 0.2 a off the crack on, to 1e-4.
Vector3 loaded_penny_displacement(const solvers::Material& material, const CutFrame& frame, double radius,
                                  const Matrix3& stress, const Vector3& x);

/// Field of an infinite body in which the faces of the ellipse (x/a)^2 + (y/b)^2 < 1 (x along frame.ahead, y along
/// frame.tangent) are apart by u+ - u- = sqrt(1 - (x/a)^2 - (y/b)^2) shape(x, y), m, by the formula for dislocation
/// loops [Volterra 1907]; the faces carry what that asks for. The rule has `rings` by `sectors` points: x is to be
/// further off the crack than they are apart.
Vector3 ellipse_jump_displacement(const solvers::Material& material, const CutFrame& frame, double a, double b,
                                  const std::function<Vector3(double x, double y)>& shape, const Vector3& x, int rings,
                                  int sectors);

/// Elliptical crack with the semi-axes a along frame.ahead and b <= a along frame.tangent, faces under pressure p: the
/// opening u+ - u- at its centre, 4 (1 - nu^2) p b / (E E(k)), k^2 = 1 - (b/a)^2, m [Green and Sneddon 1950].
double ellipse_opening(const solvers::Material& material, double a, double b, double pressure);
/// K_I at the front point (a cos t, b sin t), p sqrt(pi b) (sin^2 t + (b/a)^2 cos^2 t)^(1/4) / E(k) [Irwin 1962].
double ellipse_intensity(double a, double b, double pressure, double t);

/// Penny crack whose faces carry what remote torsion tau r / a about its axis leaves on them: they turn against each
/// other by 8 tau sqrt(a^2 - r^2) / (3 pi mu a) rad at the distance r; K_III = 4 tau sqrt(a / pi) / 3 all along
/// [Tada, Paris and Irwin; code_aster V3.04.134].
double torsion_turn(const solvers::Material& material, double radius, double shear, double r);
double torsion_intensity(double radius, double shear);

/// K_I and K_II in print of a spherical cap of radius R and half angle 45 degrees under hydrostatic tension p at nu =
/// 0.22: 0.877 and 0.235 times 2 p sqrt(R sin 45 / pi) [Martynenko and Ulitko 1979; code_aster V3.04.155], the second
/// negative with the + side outside, away from the sphere's centre. lens_by_elements() differs by 1.4 and 4 %.
solvers::Intensities lens_intensities(double sphere, double tension);

/// Intensities of the penny crack under the remote stresses s_n along its normal and the shear along frame.ahead, at
/// the front point in the direction w (rad) from frame.ahead; the tangent there is normal x outward [Kassir and Sih
/// 1966].
solvers::Intensities penny_intensities(const solvers::Material& material, double radius, double normal, double shear,
                                       double w);
/// Intensities of the penny crack under remote tension s whose direction is tilted by `tilt` (rad) from the normal
/// towards `frame.ahead`, at the front point in the direction w (rad) from frame.ahead; the tangent there is normal x
/// outward. K_I = 2 s_n sqrt(a/pi), K_II and K_III of the shear s sin cos [Kassir and Sih 1966].
solvers::Intensities tilted_penny_intensities(const solvers::Material& material, double radius, double tension,
                                              double tilt, double w);

/// K_I of a single-edge-notched strip of width W under remote tension s, crack length b (plane strain or stress), to
/// 0.5 % [Tada, Paris and Irwin].
double edge_notched_strip_intensity(double tension, double crack, double width);

} // namespace spherecut::experiments
